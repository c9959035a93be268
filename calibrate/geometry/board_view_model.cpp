// SPDX-License-Identifier: Apache-2.0
// Views of boards as a model: each view is a rigid body with its own pose in front of a camera at
// the origin. Poses come from the homography of the board (infinitesimal plane-based pose
// estimation), in a view that faces the board.
#include "calibrate/geometry/board_view_model.h"

#include <fmt/format.h>

#include <numbers>
#include <opencv2/calib3d.hpp>
#include <opencv2/core.hpp>

#include "base/error.h"
#include "calibrate/geometry/alignment.h"
#include "calibrate/geometry/opencv_pose.h"
#include "calibrate/geometry/ray_view.h"

namespace raystage::calibrate {

constexpr std::size_t kMinViews = 3, kMinLensCorners = 6;

BoardViewList::BoardViewList(std::span<const CameraBoardViews> cameras) {
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    const std::size_t before = views.size();
    for (const BoardView& view : cameras[c].views) {
      if (view.pixels.size() < kMinLensCorners) continue;
      views.push_back(&view);
      camera.push_back(c);
    }
    if (views.size() - before >= kMinViews) continue;
    throw Error::bad_input(
        fmt::format("camera \"{}\" has {} usable frames of the board; a lens needs at least {}",
                    cameras[c].id, views.size() - before, kMinViews),
        "",
        "Check the size of the board and of its squares; record it closer and in more "
        "orientations")
        .concerning({"board", "square_mm"});
  }
}

ArrayModel make_board_view_model(const BoardViewList& views,
                                 std::span<const CameraBoardViews> cameras,
                                 std::span<const schemas::Intrinsics> lenses) {
  ArrayModel model;
  for (std::size_t c = 0; c < cameras.size(); ++c) {
    model.cameras.push_back(
        {cameras[c].id, cameras[c].width, cameras[c].height, lenses[c], rig::Pose{}});
  }
  for (std::size_t v = 0; v < views.views.size(); ++v) {
    const BoardView& view = *views.views[v];
    ArrayModel::RigidBody board;
    for (std::size_t i = 0; i < view.pixels.size(); ++i) {
      const auto point = static_cast<int>(model.points.size());
      board.points.push_back(point);
      board.points_in_body.emplace_back(view.object_points[i].x(), -view.object_points[i].y(), 0);
      model.points.emplace_back();
      model.point_ids.push_back(point);
      model.observations.push_back({static_cast<int>(views.camera[v]), point, view.pixels[i]});
    }
    model.bodies.push_back(std::move(board));
  }
  return model;
}

void place_boards(ArrayModel& model, const BoardViewList& views) {
  const CameraModels lenses = camera_models(model);
  for (std::size_t v = 0; v < views.views.size(); ++v) {
    model.bodies[v].pose = estimate_board_pose(*views.views[v], lenses[views.camera[v]]);
  }
  update_body_points(model);
}

std::optional<rig::Pose> estimate_board_pose(const BoardView& view, const rig::CameraModel& lens) {
  constexpr double kLargestAngle = 80 * std::numbers::pi / 180;
  std::vector<cv::Point3d> board;
  std::vector<cv::Point2d> seen;
  std::vector<Eigen::Vector3d> rays;
  std::vector<std::size_t> corners;
  for (std::size_t i = 0; i < view.pixels.size(); ++i) {
    const auto ray = lens.unproject(view.pixels[i]);
    if (!ray) continue;
    rays.push_back(*ray);
    corners.push_back(i);
  }
  const RayView in_view(lens, rays, kLargestAngle);
  for (std::size_t k = 0; k < corners.size(); ++k) {
    const std::size_t i = corners[k];
    const auto ideal = in_view.point(rays[k]);
    if (!ideal) continue;
    board.emplace_back(view.object_points[i].x(), -view.object_points[i].y(), 0);
    seen.emplace_back(ideal->x(), ideal->y());
  }
  cv::Mat turn, translation;
  if (seen.size() < 4 || !cv::solvePnP(board, seen, cv::Mat::eye(3, 3, CV_64F), {}, turn,
                                       translation, false, cv::SOLVEPNP_IPPE)) {
    return std::nullopt;
  }
  const rig::Pose view_from_board = inverse(pose_from_opencv(turn, translation));
  return rig::Pose{in_view.camera_from_view() * view_from_board.world_from_camera_rotation,
                   in_view.camera_from_view() * view_from_board.position};
}

}  // namespace raystage::calibrate
