// SPDX-License-Identifier: Apache-2.0
#include "store/processing/mattes/seen_boxes.h"

#include <algorithm>
#include <limits>
#include <utility>

namespace raystage {
namespace {

/// Kay and Kajiya's slabs ("Ray tracing complex scenes", 1986), from the eye on.
bool goes_through(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray,
                  const MatteSettings::Box& box) {
  double begin = 0, end = std::numeric_limits<double>::infinity();
  for (std::size_t axis = 0; axis < 3; ++axis) {
    const auto i = static_cast<Eigen::Index>(axis);
    if (ray[i] == 0) {
      if (eye[i] < box[0][axis] || eye[i] > box[1][axis]) return false;
      continue;
    }
    const auto [near, far] =
        std::minmax({(box[0][axis] - eye[i]) / ray[i], (box[1][axis] - eye[i]) / ray[i]});
    begin = std::max(begin, near);
    end = std::min(end, far);
  }
  return begin <= end;
}

}  // namespace

std::vector<bool> rays_that_show(const Rig::Camera& camera,
                                 std::span<const MatteSettings::Box> keep,
                                 std::span<const MatteSettings::Box> garbage) {
  const CameraModel& model = camera.model;
  std::vector<bool> shows;
  shows.reserve(static_cast<std::size_t>(model.width()) * static_cast<std::size_t>(model.height()));
  for (int y = 0; y < model.height(); ++y) {
    for (int x = 0; x < model.width(); ++x) {
      const auto direction = model.unproject({x + 0.5, y + 0.5});
      if (!direction) {
        shows.push_back(false);
        continue;
      }
      const Eigen::Vector3d ray = camera.pose.world_from_camera_rotation * *direction;
      const auto is_seen = [&](const MatteSettings::Box& box) {
        return goes_through(camera.pose.position, ray, box);
      };
      shows.push_back((keep.empty() || std::ranges::any_of(keep, is_seen)) &&
                      std::ranges::none_of(garbage, is_seen));
    }
  }
  return shows;
}

}  // namespace raystage
