// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "render/common/world_ray.h"

namespace raystage::compose {

/// A light that surfaces see directly: a disc at infinity, or a sphere. A size of 0 is a point.
struct DirectLight {
  Eigen::Vector3d towards = Eigen::Vector3d::UnitY();  ///< unit, world; not of a sphere
  /// Radiance of a white diffuse surface that faces it; of a sphere: at 1 m from its centre.
  Eigen::Vector3f color{1, 1, 1};
  bool casts_shadows = true;
  double half_angle = 0;                         ///< of a disc, radians, below pi / 2
  std::optional<Eigen::Vector3d> position = {};  ///< of a sphere, world, metres
  double radius = 0;                             ///< of a sphere, metres

  bool has_size() const { return (position ? radius : half_angle) > 0; }
};

/// A direction to a light.
struct LightSample {
  Eigen::Vector3d towards;  ///< unit
  double distance = 0;      ///< metres of the ray that occluders may hide; infinite for a disc
  double strength = 1;      ///< times the light's colour and the cosine of incidence
};

/// Returns the factor on a light's colour that a facing surface at `point` receives: 1, or the
/// inverse square of the distance of a sphere's centre.
double light_strength(const DirectLight& light, const Eigen::Vector3d& point);

/// Samples the directions in which `point` sees a light, uniformly in solid angle. `at`: in [0,
/// 1)^2. Means over samples: a surface that faces the light receives its colour; of a sphere, its
/// colour over the squared distance of its centre. A point in a sphere sees it as at its surface.
LightSample sample_light(const DirectLight& light, const Eigen::Vector3d& point,
                         const std::array<double, 2>& at);

/// Computes the radiance (scene-linear R, G, B) of rays that leave the geometry. `spread`: of each
/// ray, radians; images are filtered accordingly. Called from many threads with many rays at once.
using EnvironmentRadiance =
    std::function<void(std::span<const render::WorldRay> rays, std::span<const float> spread,
                       std::span<Eigen::Vector3f>)>;

/// The lights of a shot's geometry.
struct Lights {
  /// Radiance from all directions: for diffuse surfaces without gathering, and for rays that leave
  /// the geometry if `environment_radiance` is null.
  Eigen::Vector3f ambient = Eigen::Vector3f::Zero();
  std::vector<DirectLight> direct;
  EnvironmentRadiance environment_radiance;  ///< null: `ambient`
  /// Rays per point with which diffuse surfaces gather light from `environment_radiance`; 0: none.
  int gather_rays = 0;
};

}  // namespace raystage::compose
