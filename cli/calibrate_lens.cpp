// SPDX-License-Identifier: Apache-2.0
// raystage calibrate lens: estimates the lens of each camera from a board.
#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <numbers>
#include <vector>

#include "base/atomic_file.h"
#include "calibrate/lens_report.h"
#include "calibrate/lenses_from_take.h"
#include "cli/board_options.h"
#include "cli/calibrate.h"
#include "cli/follow_links_option.h"
#include "cli/lens_model_option.h"
#include "cli/printing.h"
#include "cli/take_event.h"
#include "cli/threads.h"
#include "schemas/rig_document.h"

namespace raystage::cli {
namespace {

struct LensOptions {
  std::filesystem::path take, output, report;
  BoardOptions board;
  LensModelOption lens_model;
  calibrate::LensesFromTakeOptions settings;
  int threads = 0;
  bool force = false, json = false, quiet = false;
};

ExitCode run_calibrate_lens(const LensOptions& options, const std::stop_token& stop) {
  const ThreadLimit limit(options.threads);
  check_writable(options.output);
  if (!options.report.empty()) check_writable(options.report);
  const calibrate::BoardDetector detector(make_board(options.board, false));
  Progress progress(!options.quiet);
  const std::vector<calibrate::CameraLens> lenses = calibrate::calibrate_lenses(
      store::Take(options.take), detector, options.settings,
      [&](double done) { progress.report(done); }, stop);
  if (options.json) print(calibrate::lens_report_json(lenses));
  for (const calibrate::CameraLens& lens : lenses) {
    if (!options.json) print(calibrate::format_lens(lens));
  }
  if (!options.report.empty()) {
    write_file_atomically(options.report,
                          calibrate::lens_report_html(lenses, options.output.string()));
  }
  if (!calibrate::are_accepted(lenses) && !options.force) {
    throw Error::failed("the lens was not written: the calibration was rejected",
                        options.output.string(),
                        "Follow the advice under \"Next\", or use --force to write it anyway");
  }
  schemas::write_rig(calibrate::make_lens_document(lenses), options.output);
  record_rig_event(options.output, "calibrate lens");
  return ExitCode::kSuccess;
}

}  // namespace

Subcommand declare_calibrate_lens(CommandLine& calibrate) {
  auto o = std::make_shared<LensOptions>();
  CommandLine command = calibrate.subcommand(
      "lens",
      "Estimate the lens of each camera from a checkerboard or ChArUco board (Zhang's method)");
  command.option("TAKE", o->take, "The take that shows the board").required();
  command.option("-o,--output LENS.json", o->output, "Lenses to write: a rig without poses")
      .required();
  command.option("--camera ID,...", o->settings.cameras, "Cameras to calibrate (default: all)")
      .one_argument(',');
  command
      .option("--shared-lens-prior ID,...", o->settings.shared_prior,
              "Cameras of one model (ids, or: all), which share a prior: their lenses differ "
              "little except in the principal point")
      .one_argument(',');
  add_board_options(command, o->board, true);
  add_lens_model_options(
      command, o->lens_model, true,
      "; auto compares them and uses the one with the least error on boards that "
      "were held out (default: that of the take's rig)");
  command.flag("--full-lens-model", o->settings.lens.full_lens_model,
               "Also pixels that are not square, and k3 and tangential distortion of pinholes, k3 "
               "and k4 of other lenses (default: focal length, principal point, k1, k2)");
  command.option("--max-views", o->settings.max_views, "Maximum number of frames per camera")
      .show_default()
      .limits(3, 10000);
  command.flag("--force", o->force, "Write the lens even if the calibration is rejected");
  command.option("--report FILE.html", o->report, "Write an HTML page with charts of the results");
  command.flag("--json", o->json, "Print the results as JSON");
  add_threads_option(command, o->threads);
  add_follow_links_option(command);
  command.flag("-q,--quiet", o->quiet, "No progress on stderr");
  return {command, [o](const std::stop_token& stop) {
            o->settings.projection = o->lens_model.choice.projection;
            o->settings.compares_models = o->lens_model.choice.compares;
            if (o->lens_model.half_angle_deg) {
              o->settings.half_angle = *o->lens_model.half_angle_deg * std::numbers::pi / 180;
            }
            return run_calibrate_lens(*o, stop);
          }};
}

}  // namespace raystage::cli
