// SPDX-License-Identifier: Apache-2.0
// Computes a garbage matte from axis-aligned boxes in the world. Intersects the ray of every pixel
// with every box by the slab method (Kay and Kajiya, "Ray tracing complex scenes", SIGGRAPH 1986).
// Input: a camera and boxes in metres. Output: one bool per pixel. Cost: pixels times boxes.
#include "store/processing/mattes/box_mask.h"

#include <algorithm>
#include <limits>

namespace raystage::store {
namespace {

/// Returns whether the ray from `eye` intersects the box, by the slab method.
bool intersects(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray,
                const schemas::MatteSettings::Box& box) {
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

std::vector<bool> compute_box_mask(const rig::Rig::Camera& camera,
                                   std::span<const schemas::MatteSettings::Box> keep,
                                   std::span<const schemas::MatteSettings::Box> garbage) {
  const rig::CameraModel& model = camera.model;
  std::vector<bool> mask;
  mask.reserve(static_cast<std::size_t>(model.width()) * static_cast<std::size_t>(model.height()));
  for (int y = 0; y < model.height(); ++y) {
    for (int x = 0; x < model.width(); ++x) {
      const auto direction = model.unproject({x + 0.5, y + 0.5});
      if (!direction) {
        mask.push_back(false);
        continue;
      }
      const Eigen::Vector3d ray = camera.pose.world_from_camera_rotation * *direction;
      const auto is_hit = [&](const schemas::MatteSettings::Box& box) {
        return intersects(camera.pose.position, ray, box);
      };
      mask.push_back((keep.empty() || std::ranges::any_of(keep, is_hit)) &&
                     std::ranges::none_of(garbage, is_hit));
    }
  }
  return mask;
}

}  // namespace raystage::store
