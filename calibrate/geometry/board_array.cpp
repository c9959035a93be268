// SPDX-License-Identifier: Apache-2.0
// Calibrates an array from views of a flat board (see board_array.h): lenses by Zhang's method,
// then board poses per view. Cameras are compose by common boards (the link with the lowest median
// error first); a bundle adjustment with boards as rigid bodies follows. World units: metres. Cost:
// cameras squared times boards for the chain, plus bundle adjustments.
#include "calibrate/geometry/board_array.h"

#include <algorithm>
#include <map>

#include "base/error.h"
#include "base/stopwatch.h"
#include "calibrate/geometry/alignment.h"
#include "calibrate/geometry/bundle_adjustment.h"
#include "calibrate/geometry/median.h"
#include "calibrate/geometry/solve_steps.h"

namespace raystage::calibrate {
namespace {

constexpr std::size_t kMinSharedCorners = 6;
constexpr double kFirstThreshold = 12;  // pixels

/// Boards in camera, by instant.
using BoardPoses = std::map<int, rig::Pose>;

/// Returns a_from_c, given a_from_b and b_from_c.
rig::Pose compose(const rig::Pose& a_from_b, const rig::Pose& b_from_c) {
  return {a_from_b.world_from_camera_rotation * b_from_c.world_from_camera_rotation,
          a_from_b.world_from_camera(b_from_c.position)};
}

LensModel lens_model_of(const ArrayModel::Camera& camera) {
  return {camera.intrinsics.projection, camera.intrinsics.half_angle};
}

/// Returns the lens of all cameras with the lens model of one, from their boards.
schemas::Intrinsics guess_shared_lens(const ArrayModel& model,
                                      const std::vector<std::vector<BoardView>>& views,
                                      const ArrayModel::Camera& one) {
  std::vector<BoardView> all;
  for (std::size_t c = 0; c < views.size(); ++c) {
    if (lens_model_of(model.cameras[c]) != lens_model_of(one)) continue;
    all.insert(all.end(), views[c].begin(), views[c].end());
  }
  LensCalibrationOptions options;
  options.model = lens_model_of(one);
  return calibrate_lens({"all of them", one.width, one.height, all}, options).lens;
}

/// Estimates the lenses that are not given, from the boards alone.
void guess_lenses(ArrayModel& model, const std::vector<std::vector<BoardView>>& views,
                  bool for_each) {
  std::vector<std::pair<LensModel, schemas::Intrinsics>> shared_lenses;
  for (std::size_t c = 0; c < model.cameras.size(); ++c) {
    ArrayModel::Camera& camera = model.cameras[c];
    LensCalibrationOptions lens_options;
    lens_options.model = lens_model_of(camera);
    auto known = std::ranges::find_if(
        shared_lenses, [&](const auto& one) { return one.first == lens_options.model; });
    if (known == shared_lenses.end()) {
      known = shared_lenses.insert(shared_lenses.end(),
                                   {lens_options.model, guess_shared_lens(model, views, camera)});
    }
    const schemas::Intrinsics shared = known->second;
    camera.intrinsics = shared;
    constexpr std::size_t kMinViews = 6;
    if (!for_each || views[c].size() < kMinViews) continue;
    const schemas::Intrinsics own =
        calibrate_lens({camera.id, camera.width, camera.height, views[c]}, lens_options).lens;
    if (own.fx > shared.fx / 4 && own.fx < shared.fx * 4) camera.intrinsics = own;
  }
}

/// Creates a rigid body per instant with the board's points.
void add_bodies(ArrayModel& model, const BoardObjectPoints& corners) {
  const auto count = static_cast<int>(corners.size());
  std::map<int, std::size_t> body_of;
  for (std::size_t i = 0; i < model.points.size(); ++i) {
    const int number = model.point_ids[i];
    const auto [at, is_new] = body_of.emplace(number / count, model.bodies.size());
    if (is_new) model.bodies.emplace_back();
    ArrayModel::RigidBody& body = model.bodies[at->second];
    const Eigen::Vector2d& corner = corners[number % count];
    body.points.push_back(static_cast<int>(i));
    body.points_in_body.emplace_back(corner.x(), -corner.y(), 0);
  }
}

int instant_of(const ArrayModel& model, const ArrayModel::RigidBody& body,
               const BoardObjectPoints& corners) {
  return model.point_ids[body.points.front()] / static_cast<int>(corners.size());
}

/// Returns the error of a camera's corners with board poses from another camera: the median over
/// the boards that both observe, pixels.
double median_error(const std::vector<BoardView>& views, const rig::CameraModel& lens,
                    const rig::Pose& camera_from_other, const BoardPoses& other) {
  std::vector<double> errors;
  for (const BoardView& view : views) {
    const auto board = other.find(view.frame);
    if (board == other.end()) continue;
    const rig::Pose in_camera = compose(camera_from_other, board->second);
    double sum = 0;
    for (std::size_t i = 0; i < view.pixels.size(); ++i) {
      const auto seen = lens.project(
          in_camera.world_from_camera({view.object_points[i].x(), -view.object_points[i].y(), 0}));
      sum += seen ? (*seen - view.pixels[i]).norm() : 1e3;
    }
    errors.push_back(sum / static_cast<double>(view.pixels.size()));
  }
  return errors.empty() ? 1e9 : median(std::move(errors));
}

struct Link {
  double error = 1e9;
  std::size_t from = 0, to = 0;
  rig::Pose from_camera;  // from_from_to
};

/// Returns the best relative pose of two cameras: from the common board that has the lowest median
/// error on the other boards.
Link best_link(std::size_t from, std::size_t to, const std::vector<BoardPoses>& board_poses,
               const std::vector<BoardView>& views, const rig::CameraModel& lens) {
  Link best;
  for (const auto& [instant, in_from] : board_poses[from]) {
    const auto in_to = board_poses[to].find(instant);
    if (in_to == board_poses[to].end()) continue;
    const rig::Pose from_from_to = compose(in_from, inverse(in_to->second));
    const double error = median_error(views, lens, inverse(from_from_to), board_poses[from]);
    if (error < best.error) best = {error, from, to, from_from_to};
  }
  return best;
}

void place_by_boards(ArrayModel& model, const std::vector<std::vector<BoardView>>& views,
                     const std::vector<BoardPoses>& board_poses) {
  const CameraModels lenses = camera_models(model);
  const auto most = std::ranges::max_element(board_poses, {}, &BoardPoses::size);
  const auto any = std::ranges::find_if(
      model.cameras, [](const ArrayModel::Camera& camera) { return camera.pose.has_value(); });
  if (any == model.cameras.end()) model.cameras[most - board_poses.begin()].pose = rig::Pose{};
  for (;;) {
    Link best;
    for (std::size_t from = 0; from < board_poses.size(); ++from) {
      for (std::size_t to = 0; to < board_poses.size(); ++to) {
        if (!model.cameras[from].pose || model.cameras[to].pose) continue;
        const Link link = best_link(from, to, board_poses, views[to], lenses[to]);
        if (link.error < best.error) best = link;
      }
    }
    if (best.error >= 1e9) break;
    model.cameras[best.to].pose = compose(*model.cameras[best.from].pose, best.from_camera);
  }
}

/// Takes each board's pose from the camera that observes most of its corners.
void place_boards(ArrayModel& model, const BoardObjectPoints& corners,
                  const std::vector<std::vector<BoardView>>& views,
                  const std::vector<BoardPoses>& board_poses) {
  for (ArrayModel::RigidBody& body : model.bodies) {
    const int instant = instant_of(model, body, corners);
    std::size_t most = 0;
    for (std::size_t c = 0; c < views.size(); ++c) {
      const auto seen = board_poses[c].find(instant);
      if (seen == board_poses[c].end() || !model.cameras[c].pose) continue;
      const auto view = std::ranges::find(views[c], instant, &BoardView::frame);
      if (view->pixels.size() <= most) continue;
      most = view->pixels.size();
      body.pose = compose(*model.cameras[c].pose, seen->second);
    }
  }
  update_body_points(model);
}

}  // namespace

std::vector<BoardView> collect_board_views(const Detections& detections, int camera,
                                           const BoardObjectPoints& corners) {
  const auto count = static_cast<int>(corners.size());
  std::map<int, BoardView> views;
  for (const Detections::Detection& d : detections.detections) {
    if (d.camera != camera) continue;
    BoardView& view = views[d.point / count];
    view.frame = d.point / count;
    view.object_points.push_back(corners[d.point % count]);
    view.pixels.push_back(d.pixel);
  }
  std::vector<BoardView> result;
  for (auto& [instant, view] : views) {
    if (view.pixels.size() >= kMinSharedCorners) result.push_back(std::move(view));
  }
  return result;
}

ArrayModel solve_boards(const Detections& detections, const BoardObjectPoints& corners,
                        const SolveOptions& options, SolveReport& report) {
  const Stopwatch watch;
  constexpr double kAnyFov = 1;
  ArrayModel model = make_initial_model(detections, kAnyFov, options.lens_models);
  add_bodies(model, corners);
  std::vector<std::vector<BoardView>> views;
  for (std::size_t c = 0; c < model.cameras.size(); ++c) {
    views.push_back(collect_board_views(detections, static_cast<int>(c), corners));
  }
  if (options.lenses.empty()) {
    guess_lenses(model, views, options.lens_per_camera);
  } else {
    for (std::size_t c = 0; c < views.size(); ++c) model.cameras[c].intrinsics = options.lenses[c];
  }
  for (std::size_t c = 0; c < options.poses.size(); ++c) model.cameras[c].pose = options.poses[c];
  const CameraModels lenses = camera_models(model);
  std::vector<BoardPoses> board_poses(views.size());
  for (std::size_t c = 0; c < views.size(); ++c) {
    for (const BoardView& view : views[c]) {
      const auto camera_from_board = estimate_board_pose(view, lenses[c]);
      if (camera_from_board) board_poses[c].emplace(view.frame, *camera_from_board);
    }
  }
  place_by_boards(model, views, board_poses);
  place_boards(model, corners, views, board_poses);
  if (count_registered_cameras(model) < 2) {
    throw Error::bad_input("no two cameras see the board at the same time", "",
                           "Record the board where several cameras see it at once");
  }
  classify_outliers(model, 4 * kFirstThreshold);
  run_bundle_adjustment_steps(model, options, report);
  report.status = RunStatus::kFinished;
  report.seconds = watch.seconds();
  return model;
}

}  // namespace raystage::calibrate
