// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <string>
#include <vector>

#include "base/atomic_file.h"
#include "calibrate/detect/board_detection.h"
#include "calibrate/geometry/lens_calibration.h"
#include "cli/board_options.h"
#include "cli/calibrate.h"
#include "cli/threads.h"
#include "schemas/rig_document.h"

namespace raystage {
namespace {

struct LensOptions {
  std::filesystem::path take, output;
  std::vector<std::string> cameras, one_kind;
  BoardOptions board;
  LensCalibrationSettings lens;
  int most_views = 60, threads = 0;
  bool force = false, quiet = false;
};

std::vector<int> cameras_chosen(const Take& take, const std::vector<std::string>& ids) {
  std::vector<int> cameras;
  for (const std::string& id : ids) {
    cameras.push_back(take.camera_index(id));
    if (cameras.back() < 0) {
      throw Error::bad_input("there is no camera \"" + id + "\"", take.folder().string(),
                             "Name cameras of the take (raystage info)");
    }
  }
  for (int i = 0; ids.empty() && i < take.camera_count(); ++i) cameras.push_back(i);
  return cameras;
}

/// The ids of --one-kind, all of them where it says so. Throws Error (bad input).
std::vector<std::string> of_one_kind_among(const Take& take, const std::vector<int>& cameras,
                                           const std::vector<std::string>& given) {
  std::vector<std::string> ids;
  for (const int camera : cameras) {
    ids.push_back(take.document().cameras[static_cast<std::size_t>(camera)].id);
  }
  if (given == std::vector<std::string>{"all"}) return ids;
  for (const std::string& id : given) {
    if (std::ranges::find(ids, id) != ids.end()) continue;
    throw Error::bad_input("camera \"" + id + "\" is not among those whose lens is found",
                           "--one-kind", "Name cameras of the take, or of --camera; or: all");
  }
  return given;
}

void print_lens(const std::string& id, const LensCalibration& found) {
  fmt::print("Camera     {}: {:.3f} px RMS over {} corners in {} views, {} left out\n", id,
             found.rms_px, found.corners, found.views, found.outliers);
  const LensParameters values = lens_parameters(found.lens);
  for (std::size_t k = 0; k < values.size(); ++k) {
    if (found.deviations[k] == 0 && values[k] == 0) continue;
    fmt::print("Lens       {} {:.5g} +- {:.2g}\n", kLensParameterNames[k], values[k],
               found.deviations[k]);
  }
  fmt::print("Seen       {:.0f} % of the picture, tilts up to {:.0f} degrees\n",
             100 * found.image_coverage, found.max_tilt_deg);
  for (const std::string& reason : found.reasons) fmt::print("Not sure   {}\n", reason);
  for (const std::string& step : found.next_steps) fmt::print("Next       {}\n", step);
}

ExitCode calibrate_lens_of(const LensOptions& options, const std::stop_token& stop) {
  const ThreadLimit limit(options.threads);
  check_writable(options.output);
  const BoardDetector finder(make_board(options.board, false));
  const Take take(options.take);
  const std::vector<int> cameras = cameras_chosen(take, options.cameras);
  const std::vector<std::string> of_one_kind = of_one_kind_among(take, cameras, options.one_kind);
  Progress progress(!options.quiet);
  std::vector<CameraBoardViews> alike, others;
  for (std::size_t k = 0; k < cameras.size(); ++k) {
    const Rig::Camera& camera = take.rig().cameras[static_cast<std::size_t>(cameras[k])];
    auto views = detect_board_views(
        take, cameras[k], finder, options.most_views,
        [&](double done) {
          progress.report((static_cast<double>(k) + done) / static_cast<double>(cameras.size()));
        },
        stop);
    const bool is_alike = std::ranges::find(of_one_kind, camera.id) != of_one_kind.end();
    (is_alike ? alike : others)
        .push_back({camera.id, camera.model.width(), camera.model.height(), std::move(views)});
  }
  std::map<std::string, LensCalibration> found;
  LensCalibrationSettings settings = options.lens;
  settings.stop = stop;
  for (const CameraBoardViews& camera : others) found[camera.id] = calibrate_lens(camera, settings);
  if (!alike.empty()) {
    auto lenses = calibrate_lenses_with_shared_prior(alike, settings);
    for (std::size_t k = 0; k < alike.size(); ++k) found[alike[k].id] = std::move(lenses[k]);
  }
  RigDocument lenses;
  lenses.name = kUncalibratedRigName;  // where the cameras stand is not known
  bool is_sure = true;
  for (const int index : cameras) {
    const Rig::Camera& camera = take.rig().cameras[static_cast<std::size_t>(index)];
    const LensCalibration& lens = found.at(camera.id);
    print_lens(camera.id, lens);
    is_sure = is_sure && lens.reasons.empty();
    RigDocument::Camera out;
    out.geometry.id = camera.id;
    out.geometry.width = camera.model.width();
    out.geometry.height = camera.model.height();
    out.geometry.intrinsics = lens.lens;
    lenses.cameras.push_back(std::move(out));
  }
  if (!is_sure && !options.force) {
    throw Error::failed("the lens was not written: the calibration was rejected",
                        options.output.string(),
                        "Follow the advice under \"Next\", or use --force to write it anyway");
  }
  write_rig(lenses, options.output);
  return ExitCode::kSuccess;
}

}  // namespace

CalibrateCommand declare_calibrate_lens(CLI::App& calibrate) {
  auto o = std::make_shared<LensOptions>();
  CLI::App* app = calibrate.add_subcommand(
      "lens", "A camera's lens, from a checkerboard or ChArUco board shown to it (Zhang's method)");
  app->add_option("TAKE", o->take, "The take that shows the board")->required();
  app->add_option("-o,--output", o->output,
                  "The lenses, as a rig without places; for calibrate geometry --lens")
      ->required()
      ->type_name("LENS.json");
  app->add_option("--camera", o->cameras,
                  "Cameras (ids, comma separated) whose lens is found (default: all of the take)")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("ID,...");
  app->add_option("--one-kind", o->one_kind,
                  "Cameras of one make (ids, or: all): their lenses differ little but for the "
                  "principal point, so that what the board tells of one holds for the others")
      ->delimiter(',')
      ->allow_extra_args(false)
      ->type_name("ID,...");
  add_board_options(*app, o->board);
  app->get_option("--board")->required();
  app->get_option("--square-mm")->required();
  app->add_flag("--whole-lens-model", o->lens.full_lens_model,
                "Also k3, tangential distortion and pixels that are not square (default: focal "
                "length, principal point, k1, k2)");
  app->add_option("--views", o->most_views, "At most so many frames of each camera are looked at")
      ->capture_default_str()
      ->check(CLI::Range(3, 10000).description(""));
  app->add_flag("--force", o->force, "Write the lens even if the calibration is rejected");
  add_threads_option(*app, o->threads);
  app->add_flag("-q,--quiet", o->quiet, "No progress on stderr");
  return {app, [o](const std::stop_token& stop) { return calibrate_lens_of(*o, stop); }};
}

}  // namespace raystage
