// SPDX-License-Identifier: Apache-2.0
// raystage preview: encodes an EXR sequence as a movie and a contact sheet.
#include "compose/preview/preview.h"

#include <fmt/format.h>

#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "compose/frame_range.h"

int main(int argc, char** argv) {
  using namespace raystage;
  CLI::App app{"Turns an EXR sequence into a movie or pictures, and a contact sheet.",
               "raystage preview"};
  PreviewOptions options;
  std::string frames;
  std::filesystem::path color_config;
  std::string rec709_space;
  double fps = 0;
  bool black = false, quiet = false;
  std::string missing = "error";
  app.add_option("SEQUENCE", options.sequence, "the frames, e.g. DIR/NAME.####.exr")->required();
  std::string output;
  app.add_option("-o,--output", output,
                 "movie to write, .mp4, .mov or .mkv: H.264 (MPEG-4 where libx264 is absent); or "
                 "pictures,\nDIR/NAME.####.png")
      ->type_name("MOVIE|PNGS");
  app.add_flag("--burn-in", options.burn_in,
               "frame number and time code in the lower left of movie and pictures (not of the "
               "contact sheet)");
  app.add_option("--contact-sheet", options.contact_sheet, "picture to write, .png")
      ->type_name("PNG");
  app.add_option("--columns", options.sheet_columns, "columns of the contact sheet (default: 4)")
      ->check(CLI::Range(1, 100))
      ->type_name("N");
  app.add_option("--sheet-frames", options.sheet_frames,
                 "frames of the contact sheet, spread evenly over the sequence (default: 16)")
      ->check(CLI::Range(1, 10000))
      ->type_name("N");
  app.add_option("--thumbnail", options.thumbnail_width,
                 "width of a picture of the contact sheet, pixels, at most that of the frames "
                 "(default: 400)")
      ->check(CLI::Range(16, 8192))
      ->type_name("PIXELS");
  app.add_option("--frames", frames, "frames to show, e.g. 1-48x2 (default: all that exist)")
      ->type_name("RANGE");
  app.add_option(
         "--fps", fps,
         "frames per second of a movie (default: from the files; a sequence of every n-th frame\n"
         "plays at its original speed)")
      ->check(CLI::Range(0.1, 1000.0))
      ->type_name("FPS");
  app.add_option("--exposure", options.display.exposure,
                 "brighten by this many stops before the sRGB curve (default: 0)")
      ->check(CLI::Range(-32.0, 32.0))
      ->type_name("STOPS");
  app.add_option("--ocio", color_config,
                 "OpenColorIO config with the displays and views (default: a built-in one; $OCIO "
                 "is\nignored)")
      ->type_name("CONFIG");
  app.add_option("--rec709-space", rec709_space,
                 "name of linear Rec.709 in that config (default: found by common names)")
      ->type_name("SPACE");
  app.add_option("--display", options.display.monitor,
                 "display of the pictures: sRGB, Rec.1886, P3-D65 or one of the config "
                 "(default: the first)");
  app.add_option(
      "--view", options.display.view,
      "view transform: Plain = none; \"ACES 1.0 SDR\" = with a film curve; or one of the config "
      "(default:\nthe first)");
  app.add_option("--space", options.display.space,
                 "colour space of the frames, lin_rec709_scene, lin_ap1_scene or one of the config "
                 "(default:\nfrom the files, else lin_rec709_scene)");
  app.add_flag("--black", black, "composite over black (default: over a checkerboard)");
  app.add_option("--missing", missing,
                 "missing frames: error = stop; hold = repeat the one before\n"
                 "(default: error)")
      ->check(CLI::IsMember({"error", "hold"}).description(""))
      ->type_name("error|hold");
  app.add_flag("-q,--quiet", quiet, "No progress on stderr");
  return parse_and_run(app, argc, argv, "preview", [&](std::stop_token stop) {
    if (output.empty() && options.contact_sheet.empty()) {
      throw Error::bad_input("nothing to write", "",
                             "Add -o MOVIE or PNGS, --contact-sheet PNG or both");
    }
    if (output.empty() && options.burn_in) {
      throw Error::bad_input("--burn-in needs a movie or pictures", "",
                             "Add -o MOVIE or -o DIR/NAME.####.png");
    }
    if (color_config.empty() && !rec709_space.empty()) {
      throw Error::bad_input("--rec709-space needs a config", "", "Add --ocio CONFIG");
    }
    if (std::filesystem::path(output).extension() == ".png") {
      options.pictures = output;
    } else {
      options.movie = output;
    }
    if (!frames.empty()) options.frames = parse_frame_range(frames);
    if (fps > 0) options.fps = fps;
    if (black) options.display.background = Background::kBlack;
    options.hold_missing = missing == "hold";
    if (!color_config.empty()) {
      options.display.colors = ColorConfig::from_file(color_config, rec709_space);
    }
    Progress progress(!quiet);
    options.progress = [&](double done) { progress.report(done); };
    const PreviewReport report = make_preview(options, stop);
    if (report.stopped) return ExitCode::kFailed;
    std::string line = fmt::format("{} frames", report.frames);
    if (report.held > 0) line += fmt::format(", {} of them held", report.held);
    if (!report.encoder.empty()) {
      line += fmt::format("; {} ({}, {:.3f} frames/s)", options.movie.string(), report.encoder,
                          report.fps);
    }
    if (!options.pictures.empty()) line += "; " + options.pictures;
    if (!options.contact_sheet.empty()) line += "; " + options.contact_sheet.string();
    progress.say(line);
    return ExitCode::kSuccess;
  });
}
