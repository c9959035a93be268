// SPDX-License-Identifier: Apache-2.0
// raystage export mosaic: all cameras side by side in one movie.
#include "exports/export_mosaic.h"

#include <fmt/format.h>

#include <memory>

#include "cli/export.h"
#include "cli/export_options.h"
#include "cli/threads.h"

namespace raystage::cli {
namespace {

struct MosaicCommand : ExportOptions {
  std::string codec = "h264";
  int tile_width = 320, columns = 0;
};

ExitCode export_mosaic_of(const MosaicCommand& options, const std::stop_token& stop) {
  const store::Take take = open_take(options);
  exports::MosaicExportOptions mosaic;
  mosaic.output = options.output;
  mosaic.frames = frame_choice(options);
  mosaic.codec = &exports::movie_codec(options.codec);
  mosaic.tile_width = options.tile_width;
  mosaic.columns = options.columns;
  mosaic.existing = existing_files(options);
  Progress progress(!options.quiet);
  mosaic.progress = [&](double done) { progress.report(done); };
  return run_with_threads(options.threads, [&] {
    const exports::ExportReport report = exports::export_mosaic(take, mosaic, stop);
    print_report(report, options.output.string(),
                 fmt::format("{}, {:.6g} frames/s", options.codec, report.fps));
    return report.exit_code();
  });
}

}  // namespace

Subcommand declare_export_mosaic(CommandLine& command) {
  auto options = std::make_shared<MosaicCommand>();
  CommandLine mosaic = command.subcommand("mosaic", "Write all cameras side by side in one movie");
  add_take_options(mosaic, *options, "MOVIE",
                   "movie to write, .mp4, .mov or .mkv; cameras are placed as in the rig's grid");
  std::vector<std::string> names;
  std::string codecs;
  for (const exports::MovieCodec* codec : exports::movie_codecs()) {
    if (codec->copies_jpeg()) continue;
    names.emplace_back(codec->name());
    codecs += fmt::format("\n{}: {}", codec->name(), codec->description());
  }
  mosaic
      .option("--codec CODEC", options->codec, "how pictures are stored (default: h264):" + codecs)
      .one_of_listed(names);
  mosaic
      .option("--tile-width PIXELS", options->tile_width, "width of a camera's tile (default: 320)")
      .range(16, 4096);
  mosaic
      .option("--columns N", options->columns,
              "columns of tiles, in the order of the cameras (default: the rig's grid, else nearly "
              "square)")
      .range(1, 1000);
  add_frame_options(mosaic, *options, OfferedTimes::kConstant, "black");
  add_existing_option(mosaic, *options);
  add_run_options(mosaic, *options);
  return {mosaic,
          [options](const std::stop_token& stop) { return export_mosaic_of(*options, stop); }};
}

}  // namespace raystage::cli
