// SPDX-License-Identifier: Apache-2.0
// Computes the weights of the cameras for a ray by the penalties of the unstructured lumigraph
// (Buehler et al. 2001, section 3; thesis eq. 2.3; see RayWeightOptions). This is the reference in
// double for one ray. Input: a ray and its inverse distance to the proxy, 1/m. Output: contributing
// cameras, weights of sum 1. Cost: O(cameras log cameras) per ray.
#include "render/lumigraph/ray_weights.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

#include "base/options.h"
#include "render/sampling/direction_visibility.h"
#include "rig/camera_stations.h"

namespace raystage::render {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kInfinitePenalty = std::numeric_limits<double>::infinity();

double within_image(const rig::CameraModel& model, const Vector2d& pixel, double border) {
  const double to_border =
      std::min({pixel.x(), model.width() - pixel.x(), pixel.y(), model.height() - pixel.y()});
  return std::clamp(to_border / std::max(border * model.width(), 1.0), 0.0, 1.0);
}

/// Returns 2 D tan(angle / 2); see ray_weights.h. `towards`: from the camera to the point, divided
/// by D.
double angular_penalty(const Vector3d& towards, const WorldRay& ray, double inverse_distance,
                       double ray_distance) {
  const double ahead = towards.dot(ray.direction);
  // tan(angle / 2) = sin / (1 + cos) = |t x d| / (|t| + t.d), with |t x d| = ray_distance / D. For
  // a camera behind the point use (1 - cos) / sin: |t| + t.d cancels there, to 0 on the ray's line.
  const double half =
      ahead < 0 ? (towards.norm() - ahead) / (ray_distance * inverse_distance * inverse_distance)
                : ray_distance / (towards.norm() + ahead);
  return std::min(2 * half, kMaxAngularPenalty);
}

}  // namespace

bool RayWeightOptions::is_valid(std::string* reason) const {
  return is_within("cameras", cameras, 1, 10000, reason) &&
         is_within("angular", angular, 0, 1e6, reason) &&
         is_within("resolution", resolution, 0, 1e6, reason) &&
         is_within("field_of_view", field_of_view, 0, 1e6, reason) &&
         is_within("border", border, 0, 1, reason);
}

RayWeightOptions ray_weight_options(const MethodOptions& options) {
  return {options.integer("cameras"), options.number("angular"), options.number("resolution"),
          options.number("field_of_view"), options.number("border")};
}

std::vector<OptionSpec> ray_weight_options() {
  const RayWeightOptions fallback;
  constexpr double kMax = 1e6;
  return {
      integer_option("cameras", fallback.cameras, 1, kMaxWeightedCameras,
                     "number of cameras that contribute to a ray"),
      number_option("angular", fallback.angular, 0, kMax,
                    "penalty of a camera per metre of distance from the ray"),
      number_option("resolution", fallback.resolution, 0, kMax,
                    "penalty of a camera per metre that it is further from the scene than the eye"),
      number_option("field_of_view", fallback.field_of_view, 0, kMax,
                    "penalty of a camera that sees the point halfway into its image's border, "
                    "in camera spacings"),
      number_option("border", fallback.border, 0, 0.5,
                    "width of that border, as a share of the image's width")};
}

double mean_nearest_baseline(const rig::Rig& rig) {
  double sum = 0;
  for (const double baseline : rig::nearest_baselines(rig)) sum += baseline;
  const double mean = sum / static_cast<double>(rig.cameras.size());
  return mean > 0 && std::isfinite(mean) ? mean : 1;
}

std::vector<WeightedCamera> compute_camera_weights_reference(
    const rig::Rig& rig, std::span<const int> cameras, const WorldRay& ray, double inverse_distance,
    const RayWeightOptions& weighing, double spacing) {
  std::vector<WeightedCamera> found;
  std::vector<double> penalties;
  for (const int index : cameras) {
    const rig::Rig::Camera& camera = rig.cameras[index];
    const Vector3d eye_to_camera = camera.pose.position - ray.origin;
    // From camera to point, divided by the point's distance from the eye: finite at infinity too.
    const Vector3d towards = ray.direction - eye_to_camera * inverse_distance;
    WeightedCamera candidate{index, 0, 0, Vector2d::Zero(),
                             ray.direction.cross(eye_to_camera).norm()};
    candidate.seen = direction_visibility(
        camera.model, camera.pose.world_from_camera_rotation.transpose() * towards,
        candidate.pixel);
    const double within =
        std::min(candidate.seen, within_image(camera.model, candidate.pixel, weighing.border));
    if (!(within > 0)) continue;
    const double angular = angular_penalty(towards, ray, inverse_distance, candidate.ray_distance);
    const double along = eye_to_camera.dot(ray.direction);
    // (|t| - 1) / q, expanded by |t| + 1: the difference cancels for a point far away, and is
    // undefined for one at infinity.
    const double further =
        (inverse_distance * eye_to_camera.squaredNorm() - 2 * along) / (towards.norm() + 1);
    found.push_back(candidate);
    penalties.push_back(weighing.angular * angular + weighing.resolution * std::max(0.0, further) +
                        weighing.field_of_view * spacing * (1 / within - 1) +
                        kMinPenalty * spacing);
  }
  std::vector<double> sorted = penalties;
  std::sort(sorted.begin(), sorted.end());
  const auto k = static_cast<std::size_t>(weighing.cameras);
  const double threshold = sorted.size() > k ? sorted[k] * (1 + kSoftening) : kInfinitePenalty;
  double total = 0;
  for (std::size_t i = 0; i < found.size(); ++i) {
    found[i].weight = std::max(0.0, 1 - penalties[i] / threshold) / penalties[i];
    total += found[i].weight;
  }
  std::erase_if(found, [](const WeightedCamera& camera) { return camera.weight <= 0; });
  for (WeightedCamera& camera : found) camera.weight /= total;
  return found;
}

double effective_cameras(std::span<const WeightedCamera> cameras) {
  double sum = 0, squares = 0;
  for (const WeightedCamera& camera : cameras) {
    sum += camera.weight;
    squares += camera.weight * camera.weight;
  }
  return squares > 0 ? sum * sum / squares : 0;
}

double nearest_ray(std::span<const WeightedCamera> cameras) {
  double nearest = kInfinitePenalty;
  for (const WeightedCamera& camera : cameras) nearest = std::min(nearest, camera.ray_distance);
  return nearest;
}

}  // namespace raystage::render
