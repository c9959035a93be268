// SPDX-License-Identifier: Apache-2.0
// raystage export multiview: a Matroska file with a track per camera.
#include "exports/export_multiview.h"

#include <fmt/format.h>

#include <memory>

#include "cli/export.h"
#include "cli/export_options.h"

namespace raystage::cli {
namespace {

ExitCode export_multiview_of(const ExportOptions& options, const std::stop_token& stop) {
  const store::Take take = open_take(options);
  exports::MultiviewExportOptions multiview;
  multiview.output = options.output;
  multiview.frames = frame_choice(options);
  multiview.existing = existing_files(options);
  Progress progress(!options.quiet);
  multiview.progress = [&](double done) { progress.report(done); };
  const auto report = exports::export_multiview(take, multiview, stop);
  print_report(report, options.output.string(),
               fmt::format("a track per camera, {} times", options.times));
  return report.exit_code();
}

}  // namespace

Subcommand declare_export_multiview(CommandLine& command) {
  auto options = std::make_shared<ExportOptions>();
  CommandLine multiview = command.subcommand(
      "multiview", "Write one Matroska file with a track per camera: the JPEG frames as they are");
  add_take_options(multiview, *options, "FILE",
                   "file to write, .mkv; times in 1 ns, rig.json and take.json attached");
  add_frame_options(multiview, *options, OfferedTimes::kAll, "hold");
  add_existing_option(multiview, *options);
  multiview.flag("-q,--quiet", options->quiet, "no progress on stderr");
  return {multiview,
          [options](const std::stop_token& stop) { return export_multiview_of(*options, stop); }};
}

}  // namespace raystage::cli
