// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>
#include <vector>

#include "render/common/world_ray.h"

namespace raystage::compose {

/// A light at infinity.
struct DirectionalLight {
  Eigen::Vector3d towards = Eigen::Vector3d::UnitY();  ///< unit, world
  Eigen::Vector3f color{1, 1, 1};  ///< radiance of a white diffuse surface that faces it
  bool casts_shadows = true;
};

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
  std::vector<DirectionalLight> directional;
  EnvironmentRadiance environment_radiance;  ///< null: `ambient`
  /// Rays per point with which diffuse surfaces gather light from `environment_radiance`; 0: none.
  int gather_rays = 0;
};

}  // namespace raystage::compose
