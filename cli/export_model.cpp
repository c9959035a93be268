// SPDX-License-Identifier: Apache-2.0
// raystage export model: a still light field for COLMAP and NeRF.
#include "exports/export_model.h"

#include <fmt/format.h>

#include <memory>
#include <optional>

#include "cli/export.h"
#include "cli/export_options.h"
#include "cli/threads.h"

namespace raystage::cli {
namespace {

struct ModelCommand : ExportOptions {
  std::vector<std::string> formats{"colmap", "nerf"};
  std::optional<int> frame;
  bool undistorts = false;
};

ExitCode export_model_of(const ModelCommand& options, const std::stop_token& stop) {
  const store::Take take = open_take(options);
  exports::ModelExportOptions model;
  model.output = options.output;
  for (const std::string& name : options.formats) {
    model.formats.push_back(&ingest::rig_format(name));
  }
  model.cameras = options.cameras;
  model.frame = options.frame;
  model.undistorts = options.undistorts;
  Progress progress(!options.quiet);
  model.progress = [&](double done) { progress.report(done); };
  return run_with_threads(options.threads, [&] {
    const exports::ExportReport report = exports::export_model(take, model, stop);
    print_report(report, options.output.string(),
                 fmt::format("{}", fmt::join(options.formats, ", ")));
    return report.exit_code();
  });
}

}  // namespace

Subcommand declare_export_model(CommandLine& command) {
  auto options = std::make_shared<ModelCommand>();
  CommandLine model = command.subcommand(
      "model", "Write one frame of all cameras, with poses and lenses, for COLMAP and NeRF");
  add_take_options(model, *options, "FOLDER",
                   "folder to write, which must not exist: images/CAMERA.jpg, sparse/0/ (COLMAP),\n"
                   "transforms.json (NeRF), frames.csv");
  std::vector<std::string> names;
  for (const exports::ModelFormat& format : exports::model_formats()) {
    names.emplace_back(format.format->name());
  }
  model
      .option("--format FORMAT,...", options->formats,
              "formats of the cameras (default: colmap,nerf)")
      .one_of_listed(names)
      .comma_separated();
  model
      .option("--frame N", options->frame,
              "frame to export: tick N - 1 of the timeline (default: the first one that most "
              "cameras have)")
      .range(1, 100000000);
  model.flag("--undistort", options->undistorts,
             "resample all images to pinholes without distortion (default: images are the JPEG "
             "frames;\nonly lenses that a format cannot hold are resampled)");
  add_run_options(model, *options);
  return {model,
          [options](const std::stop_token& stop) { return export_model_of(*options, stop); }};
}

}  // namespace raystage::cli
