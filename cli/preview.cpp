// SPDX-License-Identifier: Apache-2.0
// raystage preview: encodes EXR sequences as a movie, pictures and a contact sheet.
#include "compose/preview/preview.h"

#include <fmt/format.h>

#include "cli/command.h"
#include "cli/command_line_parsing.h"
#include "cli/sandbox_option.h"
#include "compose/frame_range.h"

int main(int argc, char** argv) {
  using namespace raystage;
  using namespace raystage::cli;
  CommandLine command{"Turns EXR sequences into a movie or pictures, and a contact sheet.",
                      "raystage preview"};
  compose::PreviewOptions options;
  std::string frames;
  std::filesystem::path color_config;
  std::string rec709_space;
  double fps = 0;
  bool black = false, quiet = false;
  std::string missing = "error";
  compose::FramePictureOptions& pictures = options.pictures_of;
  command
      .option("SEQUENCE", pictures.sequences,
              "the frames, e.g. DIR/NAME.####.exr; several are shown side by side or compared")
      .required();
  std::string output;
  command.option("-o,--output MOVIE|PNGS", output,
                 "movie to write, .mp4, .mov or .mkv: H.264 (MPEG-4 without libx264); or "
                 "pictures,\nDIR/NAME.####.png");
  std::string compare = "side-by-side";
  command
      .option("--compare", compare,
              "several sequences: side-by-side; or of two: wipe = the first on the left of a line; "
              "difference\n= absolute difference of the values in the files (default: "
              "side-by-side)")
      .one_of({"side-by-side", "wipe", "difference"});
  command
      .option("--wipe SHARE", pictures.wipe_position,
              "position of the line of a wipe, in picture widths from the left (default: 0.5)")
      .range(0.0, 1.0);
  std::string stereo;
  command
      .option("--stereo PACKING", stereo,
              "both views of a stereo sequence in one picture: side-by-side = left, right;\n"
              "top-bottom = left above right; movies in .mp4 and .mkv say so (default: only left)")
      .one_of({"side-by-side", "top-bottom"});
  command.option("--channel NAME", pictures.channel,
                 "show a channel instead of the picture: Z in false colours (linear in inverse "
                 "depth), coverage,\nconfidence or alpha in greys, or the name of a channel in the "
                 "files, e.g. N.X");
  std::vector<double> range;
  command
      .option("--range LOW,HIGH", range,
              "values of the channel with the first and the last colour; Z: metres (default: 0,1 "
              "for\nshares, else nearly all values of the first frame)")
      .comma_separated()
      .expected(2, 2);
  command.flag("--burn-in", options.burn_in,
               "frame number and time code in the lower left of movie and pictures (not of the "
               "contact sheet)");
  command.option("--contact-sheet PNG", options.contact_sheet, "picture to write, .png");
  command.option("--columns N", options.sheet_columns, "columns of the contact sheet (default: 4)")
      .range(1, 100);
  command
      .option("--sheet-frames N", options.sheet_frames,
              "frames of the contact sheet, spread evenly over the sequence (default: 16)")
      .range(1, 10000);
  command
      .option("--thumbnail PIXELS", options.thumbnail_width,
              "width of a picture of the contact sheet, pixels, at most that of the frames "
              "(default: 400)")
      .range(16, 8192);
  command.option("--frames RANGE", frames,
                 "frames to show, e.g. 1-48x2 (default: from the first to the last file)");
  command
      .option(
          "--fps FPS", fps,
          "frames per second of a movie (default: from the files; a sequence of every n-th frame\n"
          "plays at its original speed)")
      .range(0.1, 1000.0);
  command
      .option("--exposure STOPS", pictures.display.exposure,
              "brighten by this many stops before the sRGB curve (default: 0)")
      .range(-32.0, 32.0);
  command.option("--ocio CONFIG", color_config,
                 "OpenColorIO config with the displays and views (default: a built-in one; $OCIO "
                 "is\nignored)");
  command.option("--rec709-space SPACE", rec709_space,
                 "name of linear Rec.709 in that config (default: found by common names)");
  command.option(
      "--display", pictures.display.monitor,
      "display of the pictures: sRGB, Rec.1886, P3-D65 or one of the config (default: the first)");
  command.option("--view", pictures.display.view,
                 "view transform: Plain = none; \"ACES 1.0 SDR\" = film curve; or one of the "
                 "config\n(default: the first)");
  command.option("--space", pictures.display.space,
                 "colour space of the frames, lin_rec709_scene, lin_ap1_scene or one of the config "
                 "(default:\nfrom the files, else lin_rec709_scene)");
  command.flag("--black", black, "composite over black (default: over a checkerboard)");
  command
      .option("--missing", missing,
              "missing frames: error = stop; hold = repeat the previous one (default: error)")
      .one_of({"error", "hold"});
  add_sandbox_option(command);
  command.flag("-q,--quiet", quiet, "No progress on stderr");
  return parse_and_run(command, argc, argv, "preview", [&](std::stop_token stop) {
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
    pictures.arrangement = compare == "wipe"         ? compose::Arrangement::kWipe
                           : compare == "difference" ? compose::Arrangement::kDifference
                                                     : compose::Arrangement::kSideBySide;
    if (!stereo.empty()) {
      pictures.stereo = stereo == "top-bottom" ? compose::StereoPacking::kTopBottom
                                               : compose::StereoPacking::kSideBySide;
    }
    if (pictures.arrangement != compose::Arrangement::kSideBySide &&
        pictures.sequences.size() != 2) {
      throw Error::bad_input(
          fmt::format("found {} sequence{}, --compare {} needs two", pictures.sequences.size(),
                      pictures.sequences.size() == 1 ? "" : "s", compare),
          "", "Give the two sequences to compare");
    }
    if (range.size() == 2) pictures.range = {range[0], range[1]};
    if (pictures.range && pictures.channel.empty()) {
      throw Error::bad_input("--range needs a channel", "", "Add --channel NAME");
    }
    if (pictures.range && !(range[0] < range[1])) {
      throw Error::bad_input(fmt::format("the range {},{} is empty", range[0], range[1]), "",
                             "Give the lower value first");
    }
    if (!frames.empty()) options.frames = compose::parse_frame_range(frames);
    if (fps > 0) options.fps = fps;
    if (black) pictures.display.background = compose::Background::kBlack;
    options.hold_missing = missing == "hold";
    if (!color_config.empty()) {
      pictures.display.colors = compose::ColorConfig::from_file(color_config, rec709_space);
    }
    Progress progress(!quiet);
    options.progress = [&](double done) { progress.report(done); };
    const compose::PreviewReport report = compose::make_preview(options, stop);
    if (report.status != RunStatus::kFinished) return ExitCode::kFailed;
    std::string line = fmt::format("{} frames", report.frames);
    if (report.held > 0) line += fmt::format(", {} of them held", report.held);
    if (!report.encoder.empty()) {
      line += fmt::format("; {} ({}, {:.3f} frames/s)", options.movie.string(), report.encoder,
                          report.fps);
    }
    if (!options.pictures.empty()) line += "; " + options.pictures;
    if (!options.contact_sheet.empty()) line += "; " + options.contact_sheet.string();
    if (!report.range.empty()) line += "; " + report.range;
    progress.say(line);
    return ExitCode::kSuccess;
  });
}
