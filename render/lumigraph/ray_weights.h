// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <vector>

#include "render/common/light_field_frame.h"
#include "render/common/method_options.h"
#include "render/common/world_ray.h"

namespace raystage::render {

/// Settings of the cameras' penalties and weights for a ray.
///
/// The ray from the eye E meets the proxy at P, at distance D. A camera at C has the penalty, in
/// metres,
///   p = angular * a + resolution * r + field_of_view * spacing * (1 / v - 1):
///   a = 2 D tan(angle / 2), where angle is the angle at P between E and C. For small angles, and
///       exactly for P at infinity, a is the camera's distance from the ray. For a camera behind P
///       it grows as the camera approaches the ray's line, up to kMaxAngularPenalty instead of
///       infinity.
///   r = max(0, |C - P| - D): the extra distance, thus coarser resolution, of the camera.
///   v in (0, 1]: 1 if the camera sees P within its image, falling to 0 in the image's border.
/// Source: thesis eq. 2.3; Buehler, Bosse, McMillan, Gortler and Cohen, "Unstructured Lumigraph
/// Rendering", SIGGRAPH 2001, section 3.
///
/// The k cameras of lowest penalty have the weights
///   (1 - p / p_{k+1}) / p.
/// They fall to 0 where a camera is replaced by the next: smooth in the ray. p_{k+1} is raised by
/// kSoftening, so that weights exist if more than k cameras have equal penalties.
struct RayWeightOptions {
  int cameras = 4;  ///< k
  double angular = 1, resolution = 0.05, field_of_view = 1;
  /// Width of the border in which v falls to 0, as a share of the image's width.
  double border = 0.05;
  bool is_valid(std::string* reason) const;
};

inline constexpr int kMaxWeightedCameras = 16;
inline constexpr double kSoftening = 1e-4;
/// Smallest penalty, in camera spacings: a ray through a camera's centre has a finite weight.
inline constexpr double kMinPenalty = 1e-6;
/// Largest a, metres: practically infinite, but a camera that alone sees the point still counts.
inline constexpr double kMaxAngularPenalty = 1e20;

/// Returns the settings from a method's options of the same names.
RayWeightOptions ray_weight_options(const MethodOptions& options);
std::vector<OptionSpec> ray_weight_options();  ///< returns these options

/// Returns the mean distance of the cameras from their nearest neighbours at other stations
/// (rig/camera_stations.h), metres; 1 for a single station.
double mean_nearest_baseline(const rig::Rig& rig);

struct WeightedCamera {
  int camera = 0;     ///< of the rig
  double weight = 0;  ///< above 0; 1 in total
  double seen = 0;    ///< 1, falling to 0 at the image's border (see kBorderFade)
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< where it sees the point
  double ray_distance = 0;                          ///< metres from its centre to the ray's line
};

/// Returns the contributing cameras by index, or none: the reference of the weights, for one ray
/// that meets the proxy at 1 / `inverse_distance`. `cameras`: the candidates.
std::vector<WeightedCamera> compute_camera_weights_reference(
    const rig::Rig& rig, std::span<const int> cameras, const WorldRay& ray, double inverse_distance,
    const RayWeightOptions& weighing, double spacing);

/// Returns the effective number of equally weighted cameras: (sum w)^2 / sum w^2; 0 if empty.
double effective_cameras(std::span<const WeightedCamera> cameras);
/// Returns the smallest `ray_distance`; infinity if empty.
double nearest_ray(std::span<const WeightedCamera> cameras);

}  // namespace raystage::render
