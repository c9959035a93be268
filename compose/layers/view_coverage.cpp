// SPDX-License-Identifier: Apache-2.0
// Estimates which rays of a view no camera recorded, whatever is there: see uncovered_ray_share().
// Points at evenly spaced inverse depths of each ray are projected into the cameras until one of
// them has the point in its frame. Cost: at most rays x depths x cameras projections, about 10 ms
// for 64 cameras if nothing is covered.
#include "compose/layers/view_coverage.h"

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

namespace raystage::compose {
namespace {

constexpr int kColumns = 24, kRows = 14, kDepths = 12;

bool is_seen(const rig::Rig& rig, const Eigen::Vector3d& point) {
  return std::ranges::any_of(rig.cameras, [&](const rig::Rig::Camera& camera) {
    const auto pixel = camera.model.project(camera.pose.camera_from_world(point));
    return pixel && camera.model.contains(*pixel);
  });
}

}  // namespace

double uncovered_ray_share(const rig::Rig& rig, const render::VirtualCamera& view,
                           const std::optional<schemas::DepthRange>& scene) {
  constexpr double kNearest = 0.1, kFarthest = 1e9;  // metres
  const double nearest = 1 / (scene ? scene->near : kNearest);
  const double farthest = 1 / std::min(scene ? scene->far : kFarthest, kFarthest);
  const Eigen::Vector3d forward = rig.mean_viewing_direction(), centre = rig.centre();
  const schemas::Intrinsics& k = view.intrinsics;
  int uncovered = 0;
  for (int row = 0; row < kRows; ++row) {
    for (int column = 0; column < kColumns; ++column) {
      const double x = (column + 0.5) / kColumns * view.width;
      const double y = (row + 0.5) / kRows * view.height;
      const Eigen::Vector3d direction =
          view.pose.world_from_camera_rotation *
          Eigen::Vector3d((x - k.cx) / k.fx, (k.cy - y) / k.fy, -1).normalized();
      const double ahead = direction.dot(forward);  // depth per metre along the ray
      const double begin = (view.pose.position - centre).dot(forward);
      const bool covered = [&] {
        for (int i = 0; i < kDepths; ++i) {
          const double inverse = farthest + (nearest - farthest) * i / (kDepths - 1);
          const double distance = (1 / inverse - begin) / ahead;
          if (!(distance > 0)) continue;  // the depth is behind the view's camera
          if (is_seen(rig, view.pose.position + distance * direction)) return true;
        }
        return false;
      }();
      if (!covered) ++uncovered;
    }
  }
  return static_cast<double>(uncovered) / (kColumns * kRows);
}

}  // namespace raystage::compose
