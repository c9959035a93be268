// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <optional>
#include <span>
#include <vector>

#include "render/common/world_ray.h"

namespace raystage {

/// A light far away.
struct DirectionalLight {
  Eigen::Vector3d towards = Eigen::Vector3d::UnitY();  ///< unit, world
  Eigen::Vector3f color{1, 1, 1};  ///< what a white diffuse surface that faces it shows
  bool casts_shadows = true;
};

/// What rays see that leave the geometry: radiance, scene-linear, R, G, B. `spread`: of each ray,
/// radians, so that pictures are looked at in no more detail than that. Called from many threads
/// with many rays at a time.
using EnvironmentRadiance = std::function<void(
    std::span<const WorldRay> rays, std::span<const float> spread, std::span<Eigen::Vector3f>)>;

/// What lights the geometry of a shot.
struct Lights {
  /// The same from everywhere: for diffuse surfaces that do not gather, and for rays that leave
  /// where there are no environment_radiance.
  Eigen::Vector3f ambient = Eigen::Vector3f::Zero();
  std::vector<DirectionalLight> directional;
  EnvironmentRadiance environment_radiance;  ///< null: `ambient` all around
  /// Rays by which a diffuse surface gathers light from its environment_radiance; 0: it does not.
  int gather_rays = 0;
};

}  // namespace raystage
