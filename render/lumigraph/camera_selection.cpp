// SPDX-License-Identifier: Apache-2.0
// Selects the cameras that can contribute to a bundle of rays. Bounds each camera's penalty over
// the bundle (ray_weights.h) and removes the cameras whose lower bound exceeds a threshold. This is
// the (k+1)-th upper bound of the cameras that see all of the bundle. Input: corner rays and
// inverse distances in 1/m. Cost: O(cameras log cameras) per bundle.
#include "render/lumigraph/camera_selection.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace raystage::render {
namespace {

using Eigen::Vector3d;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Bounds {
  double least = 0, most = 0;
};

/// Returns bounds of the penalty without its term for the field of view.
Bounds penalty_bounds(const Vector3d& eye_to_camera, const Vector3d& axis, double angle,
                      const RayBundle& bundle, const RayWeightOptions& weighing) {
  // Distance from a ray and length along it change by at most this from the axis to any ray.
  const double change = eye_to_camera.norm() * angle;
  const double beside = eye_to_camera.cross(axis).norm(), along = eye_to_camera.dot(axis);
  const double least_beside = std::max(0.0, beside - change), most_beside = beside + change;
  const auto ahead = std::minmax({1 - (along - change) * bundle.min_inverse_distance,
                                  1 - (along - change) * bundle.max_inverse_distance,
                                  1 - (along + change) * bundle.min_inverse_distance,
                                  1 - (along + change) * bundle.max_inverse_distance});
  // tan(angle / 2) times the point's distance. It falls with the length ahead and with the inverse
  // distance. With the distance from the ray it grows for a camera in front of the point; for a
  // camera behind the point it falls from infinity.
  const auto half_angular = [](double beside_ray, double inverse, double ahead_of) {
    const double across = beside_ray * inverse, side = std::hypot(across, ahead_of);
    if (ahead_of < 0) return (side - ahead_of) / (across * inverse);
    return side > 0 ? beside_ray / (side + ahead_of) : 1 / inverse;
  };
  const double least_angular = 2 * half_angular(ahead.second < 0 ? most_beside : least_beside,
                                                bundle.max_inverse_distance, ahead.second);
  const double most_angular = 2 * half_angular(ahead.first < 0 ? least_beside : most_beside,
                                               bundle.min_inverse_distance, ahead.first);
  const double least_further = std::max(0.0, -(along + change));
  // Two sides of a triangle differ by at most the third; this also replaces NaN.
  const double any_further = eye_to_camera.norm();
  const double longer =
      change - along + most_beside * bundle.max_inverse_distance * (most_angular / 2);
  const double most_further = longer < any_further ? std::max(0.0, longer) : any_further;
  Bounds bounds;
  bounds.least = weighing.angular * least_angular + weighing.resolution * least_further;
  // Avoid 0 times infinity.
  bounds.most = (weighing.angular > 0 ? weighing.angular * most_angular : 0) +
                (weighing.resolution > 0 ? weighing.resolution * most_further : 0);
  return bounds;
}

/// Returns whether the camera sees all points of the bundle, away from its image's border. Without
/// distortion the hull of the corners contains them; a margin allows for the bend by the lens.
bool sees_all(const rig::Rig::Camera& camera, const RayBundle& bundle,
              const RayWeightOptions& weighing) {
  constexpr double kMargin = 2;  // pixels
  const rig::CameraModel& model = camera.model;
  const double border = std::max(weighing.border * model.width(), 1.0) + kMargin;
  for (const Vector3d& corner : bundle.corners) {
    for (const double inverse : {bundle.min_inverse_distance, bundle.max_inverse_distance}) {
      const Vector3d towards = corner - (camera.pose.position - bundle.eye) * inverse;
      const auto pixel =
          model.project(camera.pose.world_from_camera_rotation.transpose() * towards);
      if (!pixel || pixel->x() < border || pixel->y() < border ||
          pixel->x() > model.width() - border || pixel->y() > model.height() - border) {
        return false;
      }
    }
  }
  return true;
}

}  // namespace

std::vector<int> select_candidate_cameras(const rig::Rig& rig, std::span<const int> cameras,
                                          const RayBundle& bundle, const RayWeightOptions& weighing,
                                          double spacing) {
  Vector3d axis = Vector3d::Zero();
  for (const Vector3d& corner : bundle.corners) axis += corner;
  axis.normalize();
  double angle = 0;
  for (const Vector3d& corner : bundle.corners) {
    angle = std::max(angle, std::atan2(axis.cross(corner).norm(), axis.dot(corner)));
  }
  std::vector<Bounds> bounds;
  std::vector<std::size_t> by_most(cameras.size());
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    const Vector3d offset = rig.cameras[cameras[i]].pose.position - bundle.eye;
    bounds.push_back(penalty_bounds(offset, axis, angle, bundle, weighing));
    by_most[i] = i;
  }
  std::sort(by_most.begin(), by_most.end(), [&](std::size_t a, std::size_t b) {
    return bounds[a].most < bounds[b].most || (bounds[a].most == bounds[b].most && a < b);
  });
  // Cameras beyond the (k+1)-th of those that see the whole bundle have no weight.
  double threshold = kInfinity;
  int seeing = 0;
  for (const std::size_t i : by_most) {
    if (!sees_all(rig.cameras[cameras[i]], bundle, weighing)) continue;
    if (++seeing <= weighing.cameras) continue;
    threshold = bounds[i].most;
    break;
  }
  constexpr double kRounding = 1e-3;  // margin for the kernels' floats and kSoftening
  std::vector<int> chosen;
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    if (!(bounds[i].least > threshold * (1 + kRounding) + kRounding * spacing)) {
      chosen.push_back(cameras[i]);
    }
  }
  return chosen;
}

}  // namespace raystage::render
