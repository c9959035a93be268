// SPDX-License-Identifier: Apache-2.0
// raystage export depth: the depth maps of the cameras.
#include <fmt/format.h>

#include <memory>
#include <optional>

#include "cli/export.h"
#include "cli/export_options.h"
#include "cli/sandbox_option.h"
#include "cli/threads.h"
#include "exports/export_depths.h"
#include "store/scene_depth_range.h"

namespace raystage::cli {
namespace {

struct DepthCommand : ExportOptions {
  bool is_png = false;
  std::optional<double> near, far;
  render::DepthQuantity quantity = render::DepthQuantity::kPlanar;
};

ExitCode export_depth_of(const DepthCommand& options, const std::stop_token& stop) {
  if (!options.is_png && (options.near || options.far)) {
    throw Error::bad_input("EXR files have no range of depths", "--near, --far",
                           "Add --format png, or omit the range");
  }
  const store::Take take = open_take(options);
  exports::DepthExportOptions depth;
  depth.output = options.output;
  depth.frames = frame_choice(options);
  depth.quantity = options.quantity;
  std::string what = "exr";
  if (options.is_png) {
    const schemas::DepthRange range =
        store::scene_depth_range(take, {options.near.value_or(0), options.far.value_or(0)},
                                 "--format png", "Add --near and --far");
    // The range of the take is measured from the centre of the array, not from each camera.
    constexpr double kMargin = 1.25;
    depth.png_range = schemas::DepthRange{options.near.value_or(range.near / kMargin),
                                          options.far.value_or(range.far * kMargin)};
    what = fmt::format("png, inverse depths from --depth-near {} to --depth-far {}",
                       depth.png_range->near, depth.png_range->far);
  }
  Progress progress(!options.quiet);
  depth.progress = [&](double done) { progress.report(done); };
  return run_with_threads(options.threads, [&] {
    const exports::ExportReport report = exports::export_depths(take, depth, stop);
    print_report(report, options.output.string(), what);
    return report.exit_code();
  });
}

}  // namespace

Subcommand declare_export_depth(CommandLine& command) {
  auto options = std::make_shared<DepthCommand>();
  CommandLine depth = command.subcommand(
      "depth", "Write the depth maps of the cameras, imported or estimated by the method depth");
  add_take_options(depth, *options, "FOLDER",
                   "folder to write, which must not exist: CAMERA/000001.exr, in the pixels of the "
                   "recorded\npictures, and rig.json; raystage import --depth reads it");
  depth.choice("--format", options->is_png, {{"exr", false}, {"png", true}},
               "exr: metres, channel Z, 0 = unknown; png: 16-bit inverse depths, 1/d = code/65535 "
               "(1/near -\n1/far) + 1/far, code 0 = unknown (default: exr)");
  depth
      .option("--near M", options->near,
              "depth of code 65535, metres (default: 0.8 times the nearest depth of the take)")
      .positive();
  depth
      .option("--far M", options->far,
              "depth of code 0, metres (default: 1.25 times the farthest depth of the take)")
      .positive();
  depth.choice(
      "--kind", options->quantity,
      {{"planar", render::DepthQuantity::kPlanar}, {"distance", render::DepthQuantity::kDistance}},
      "planar: depth along the camera's axis; distance: from the camera's centre, for "
      "fisheyes (default:\nplanar)");
  depth.option("--frames RANGE", options->frames,
               "frames to export, e.g. 1-48, 1-48x2, 1,5,10-20; frame n is tick n - 1 of the "
               "timeline (default: all)");
  add_sandbox_option(depth);
  add_run_options(depth, *options);
  return {depth,
          [options](const std::stop_token& stop) { return export_depth_of(*options, stop); }};
}

}  // namespace raystage::cli
