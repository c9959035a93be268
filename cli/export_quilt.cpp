// SPDX-License-Identifier: Apache-2.0
// raystage export quilt: rendered views for autostereoscopic displays.
#include "exports/export_quilt.h"

#include <fmt/format.h>

#include <memory>

#include "cli/export.h"
#include "cli/follow_links_option.h"
#include "cli/printing.h"
#include "cli/sandbox_option.h"
#include "cli/threads.h"
#include "compose/frame_range.h"

namespace raystage::cli {
namespace {

struct QuiltCommand {
  exports::QuiltExportOptions options;
  std::string frames, codec = "h264";
  bool overwrites = false, quiet = false;
  int threads = 0;
};

ExitCode export_quilt_of(QuiltCommand& command, const std::stop_token& stop) {
  exports::QuiltExportOptions options = command.options;
  if (!command.frames.empty()) options.frames = compose::parse_frame_range(command.frames);
  options.codec = &exports::movie_codec(command.codec);
  if (command.overwrites) options.existing = exports::ExistingFiles::kOverwrite;
  Progress progress(!command.quiet);
  options.progress = [&](double done) { progress.report(done); };
  return run_with_threads(command.threads, [&] {
    const exports::QuiltReport report = exports::export_quilt(options, stop);
    if (report.held > 0) {
      print_error("note: {} frames show the nearest instant of a take that lacks theirs\n",
                  report.held);
    }
    if (report.black > 0) {
      print_error("note: {} frames have black views, because a camera of the row has no frame\n",
                  report.black);
    }
    if (report.rotten > 0) {
      print_error(
          "warning: frames without cameras whose stored frames are not as they were recorded "
          "(XXH3): {}\n",
          report.rotten);
    }
    constexpr double kWhole = 0.995;
    if (report.least_covered_share < kWhole) {
      print_error(
          "note: cameras saw {:.1f} % of the pixels of the least covered view; a smaller "
          "--baseline-m shows less beside the array\n",
          100 * report.least_covered_share);
    }
    print("{}: {} frame{} of {} views, {}x{} pixels; screen at {:.3g} m, views over {:.3g} m\n",
          report.files, report.frames, report.frames == 1 ? "" : "s", report.views, report.width,
          report.height, report.screen_m, report.baseline_m);
    return report.exit_code();
  });
}

}  // namespace

Subcommand declare_export_quilt(CommandLine& command) {
  auto quilt = std::make_shared<QuiltCommand>();
  exports::QuiltExportOptions& options = quilt->options;
  CommandLine line = command.subcommand(
      "quilt", "Render views for displays without glasses (Looking Glass) into one picture");
  line.option("TAKE|SHOT", options.input,
              "the take, seen from the centre of its array, or a shot (shot.json)")
      .required();
  line.option("-o,--output PNGS|MOVIE", options.output,
              "picture or movie to write: NAME.png, NAME.####.png, NAME.mp4 (.mov, .mkv);\n"
              "_qsCOLUMNSxROWSaASPECT is added to the name")
      .required();
  line.option("--columns N", options.columns, "columns of views (default: 8)").range(1, 64);
  line.option("--rows N", options.rows, "rows of views (default: 6)").range(1, 64);
  line.option("--view-width PIXELS", options.view_width, "width of a view (default: 420)")
      .range(16, 8192);
  line.option("--aspect RATIO", options.aspect,
              "width / height of the display, e.g. 0.75 (default: that of the shot)")
      .range(0.05, 20.0);
  line.option("--screen-m M", options.screen_m,
              "distance of the plane that appears in the screen, metres (default: the shot's focus "
              "distance;\nof a take its optimal focal depth, thesis eq. 2.2)")
      .range(1e-3, 1e6);
  line.option("--baseline-m M", options.baseline_m,
              "distance from the first to the last virtual camera, metres (default: 0.9 times the "
              "width of\nthe array)")
      .range(0.0, 1000.0);
  line.option("--array-row ROW", options.array_row,
              "views are the frames of this row of the array's own cameras, rectified, instead of "
              "rendered\nones; as many views as cameras (default: views are rendered)")
      .range(0, 100000);
  line.option("--method METHOD", options.method,
              "reconstruction method of all takes (default: the shot's; of a take plane_sweep)");
  line.option("--frames RANGE", quilt->frames,
              "frames of the shot; frame n of a take is tick n - 1 (default: the first frame, of "
              "a movie all)");
  std::vector<std::string> names;
  for (const exports::MovieCodec* codec : exports::movie_codecs()) {
    if (!codec->copies_jpeg()) names.emplace_back(codec->name());
  }
  line.option("--codec CODEC", quilt->codec,
              "of movies, as of raystage export mosaic (default: h264)")
      .one_of_listed(names);
  line.choice("--existing", quilt->overwrites, {{"error", false}, {"overwrite", true}},
              "files that exist: error = stop before anything is written; overwrite (default: "
              "error)");
  add_follow_links_option(line);
  add_sandbox_option(line);
  add_threads_option(line, quilt->threads);
  line.flag("-q,--quiet", quilt->quiet, "no progress on stderr");
  return {line, [quilt](const std::stop_token& stop) { return export_quilt_of(*quilt, stop); }};
}

}  // namespace raystage::cli
