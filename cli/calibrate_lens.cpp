// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <filesystem>
#include <memory>
#include <vector>

#include "base/atomic_file.h"
#include "calibrate/lenses_from_take.h"
#include "cli/board_options.h"
#include "cli/calibrate.h"
#include "cli/threads.h"
#include "schemas/rig_document.h"

namespace raystage {
namespace {

struct LensOptions {
  std::filesystem::path take, output;
  BoardOptions board;
  LensesFromTakeSettings settings;
  int threads = 0;
  bool force = false, quiet = false;
};

ExitCode run_calibrate_lens(const LensOptions& options, const std::stop_token& stop) {
  const ThreadLimit limit(options.threads);
  check_writable(options.output);
  const BoardDetector detector(make_board(options.board, false));
  Progress progress(!options.quiet);
  const std::vector<CameraLens> lenses = calibrate_lenses(
      Take(options.take), detector, options.settings, [&](double done) { progress.report(done); },
      stop);
  for (const CameraLens& lens : lenses) fmt::print("{}", format_lens(lens));
  if (!are_accepted(lenses) && !options.force) {
    throw Error::failed("the lens was not written: the calibration was rejected",
                        options.output.string(),
                        "Follow the advice under \"Next\", or use --force to write it anyway");
  }
  write_rig(make_lens_document(lenses), options.output);
  return ExitCode::kSuccess;
}

}  // namespace

CalibrateCommand declare_calibrate_lens(CLI::App& calibrate) {
  auto o = std::make_shared<LensOptions>();
  CLI::App* app = calibrate.add_subcommand(
      "lens",
      "Estimate the lens of each camera from a checkerboard or ChArUco board (Zhang's method)");
  app->add_option("TAKE", o->take, "The take that shows the board")->required();
  app->add_option("-o,--output", o->output,
                  "The lenses to write, as a rig without poses; for calibrate geometry --lens")
      ->required()
      ->type_name("LENS.json");
  app->add_option("--camera", o->settings.cameras,
                  "Cameras to calibrate (ids, comma separated; default: all of the take)")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("ID,...");
  app->add_option(
         "--shared-lens-prior", o->settings.shared_prior,
         "Cameras of one model (ids, or: all), which share a prior: their lenses differ little "
         "except in the principal point")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("ID,...");
  add_board_options(*app, o->board);
  app->get_option("--board")->required();
  app->get_option("--square-mm")->required();
  app->add_flag("--full-lens-model", o->settings.lens.full_lens_model,
                "Also k3, tangential distortion and pixels that are not square (default: focal "
                "length, principal point, k1, k2)");
  app->add_option("--max-views", o->settings.max_views,
                  "Maximum number of frames of each camera to search")
      ->capture_default_str()
      ->check(CLI::Range(3, 10000).description(""));
  app->add_flag("--force", o->force, "Write the lens even if the calibration is rejected");
  add_threads_option(*app, o->threads);
  app->add_flag("-q,--quiet", o->quiet, "No progress on stderr");
  return {app, [o](const std::stop_token& stop) { return run_calibrate_lens(*o, stop); }};
}

}  // namespace raystage
