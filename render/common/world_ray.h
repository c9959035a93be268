// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <span>

namespace raystage::render {

/// Any ray, whether it belongs to a view or not. World frame, metres.
struct WorldRay {
  Eigen::Vector3d origin = Eigen::Vector3d::Zero();
  Eigen::Vector3d direction = -Eigen::Vector3d::UnitZ();  ///< unit
};

/// Intersects rays with a surface in front of their origins. Writes 1 / (distance along the ray),
/// per metre: 0 for a point at infinity, not-a-number for a ray that meets nothing. Called from
/// many threads, with some dozens of rays at a time.
using RaySurface =
    std::function<void(std::span<const WorldRay> rays, std::span<double> inverse_distance)>;

}  // namespace raystage::render
