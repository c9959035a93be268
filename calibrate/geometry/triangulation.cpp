// SPDX-License-Identifier: Apache-2.0
// Triangulates points as the least-squares intersection of rays: all rays first, then pairs of
// rays, and keeps the position with the most inliers. Input: observed pixels and poses; output:
// points, world units. Cost: rays squared per point.
#include "calibrate/geometry/triangulation.h"

#include <Eigen/Dense>
#include <vector>

#include "rig/camera_model.h"

namespace raystage::calibrate {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

struct Ray {
  Vector3d origin, direction;  // unit
};

/// Returns the point with the least sum of squared distances from the rays; none if they are almost
/// parallel.
std::optional<Vector3d> nearest_point(const std::vector<Ray>& rays) {
  constexpr double kMinAngle = 1e-3;  // radians between two of them
  bool differ = false;
  Matrix3d sum = Matrix3d::Zero();
  Vector3d right = Vector3d::Zero();
  for (const Ray& ray : rays) {
    differ = differ || ray.direction.cross(rays.front().direction).norm() > kMinAngle;
    const Matrix3d across = Matrix3d::Identity() - ray.direction * ray.direction.transpose();
    sum += across;
    right += across * ray.origin;
  }
  if (!differ) return std::nullopt;
  return sum.ldlt().solve(right);
}

}  // namespace

void triangulate_points(ArrayModel& model, double max_error_px) {
  const CameraModels lenses = camera_models(model);
  for (std::size_t begin = 0; begin < model.observations.size();) {
    const int point = model.observations[begin].point;
    std::size_t end = begin;
    std::vector<Ray> rays;
    std::vector<std::size_t> of_rays;
    for (; end < model.observations.size() && model.observations[end].point == point; ++end) {
      const auto camera = static_cast<std::size_t>(model.observations[end].camera);
      const auto& pose = model.cameras[camera].pose;
      const auto in_camera = lenses[camera].unproject(model.observations[end].pixel);
      if (!pose || !in_camera) continue;
      rays.push_back(
          {pose->position, (pose->world_from_camera_rotation * *in_camera).normalized()});
      of_rays.push_back(end);
    }
    begin = end;
    auto& place = model.points[point];
    if (place || rays.size() < 2) continue;
    // All rays first; if some are outliers, the pair with the most inliers.
    std::vector<std::vector<Ray>> tries{rays};
    for (std::size_t a = 0; a < rays.size() && rays.size() > 2; ++a) {
      for (std::size_t b = a + 1; b < std::min(rays.size(), a + 4); ++b) {
        tries.push_back({rays[a], rays[b]});
      }
    }
    std::size_t best = 1;
    for (const std::vector<Ray>& chosen : tries) {
      const auto found = nearest_point(chosen);
      if (!found) continue;
      std::size_t agree = 0;
      for (const std::size_t i : of_rays) {
        const ArrayModel::Observation& observation = model.observations[i];
        const auto seen = lenses[observation.camera].project(
            model.cameras[observation.camera].pose->camera_from_world(*found));
        agree += seen && (*seen - observation.pixel).norm() <= max_error_px ? 1 : 0;
      }
      if (agree <= best) continue;
      best = agree;
      place = found;
      if (agree == rays.size()) break;
    }
  }
}

}  // namespace raystage::calibrate
