// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "render/common/light_field_frame.h"
#include "render/common/method_options.h"
#include "render/common/world_ray.h"

namespace raystage {

/// What a camera's distance from a ray is made of.
///
/// The ray from the eye E meets the proxy at P, D metres away. A camera at C has the penalty
///   p = angular * a + resolution * r + field_of_view * spacing * (1 / v - 1), metres:
///   a = 2 D tan(angle / 2), of the angle at P between E and C: for small angles how far the camera
///       lies beside the ray; for P at infinity exactly that; for one that looks from behind P it
///       grows the nearer that lies to the ray's line: on it to kMaxAngularPenalty, instead of
///       infinity.
///   r = max(0, |C - P| - D): how much further away the camera saw P, thus coarser.
///   v in (0, 1]: how well within its image the camera sees P, 1 but for the image's border.
/// (Eq. 2.3; Buehler, Bosse, McMillan, Gortler and Cohen, "Unstructured Lumigraph Rendering",
/// SIGGRAPH 2001, section 3.) The k cameras of least penalty count by
///   (1 - p / p_{k+1}) / p,
/// which falls to 0 where a camera gives way to the next: smooth in the ray. p_{k+1} is raised by
/// kSoftening, so that weights exist too where more than k cameras are equally far.
struct RayWeightSettings {
  int cameras = 4;  ///< k
  double angular = 1, resolution = 0.05, field_of_view = 1;
  /// Width of the border in which v falls to 0, as a share of the image's width.
  double border = 0.05;
};

/// Largest k.
inline constexpr int kMaxWeightedCameras = 16;
inline constexpr double kSoftening = 1e-4;
/// Least penalty, in camera spacings: a ray straight through a camera has a finite weight.
inline constexpr double kMinPenalty = 1e-6;
/// Largest a, metres: next to any other camera as good as infinite, yet who alone sees the point
/// counts, wherever it is.
inline constexpr double kMaxAngularPenalty = 1e20;

/// From a method's options of the same names.
RayWeightSettings ray_weight_settings(const MethodOptions& options);
/// The options themselves.
std::vector<OptionSpec> ray_weight_options();

/// Mean distance of the cameras from their nearest neighbours, metres; 1 for a single one, or where
/// all coincide.
double max_neighbour_baseline(const Rig& rig);

/// A camera that counts for a ray.
struct WeightedCamera {
  int camera = 0;     ///< of the rig
  double weight = 0;  ///< above 0; 1 in total
  double seen = 0;    ///< 1, falling to 0 at the image's border (see kBorderFade)
  Eigen::Vector2d pixel = Eigen::Vector2d::Zero();  ///< where it sees the point
  double beside = 0;                                ///< metres from its centre to the ray's line
};

/// The slow, obvious way, for one ray that meets the proxy at 1 / `inverse_distance`. `cameras`:
/// who may count. By camera; empty where none sees the point.
std::vector<WeightedCamera> compute_camera_weights_reference(
    const Rig& rig, std::span<const int> cameras, const WorldRay& ray, double inverse_distance,
    const RayWeightSettings& weighing, double spacing);

/// How many cameras of equal weight would be as many: (sum w)^2 / sum w^2; 0 for none.
double effective_cameras(std::span<const WeightedCamera> cameras);
/// The least `beside`; infinity for none.
double nearest_ray(std::span<const WeightedCamera> cameras);

}  // namespace raystage
