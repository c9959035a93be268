// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include "render/lumigraph/ray_weights.h"

namespace raystage::render {

/// Rays from one eye through a rectangle of pixels, with bounds on their lengths.
struct RayBundle {
  Eigen::Vector3d eye;
  std::array<Eigen::Vector3d, 4> corners;                     ///< unit directions
  double min_inverse_distance = 0, max_inverse_distance = 0;  ///< of the points, 1/m
};

/// Returns those of `cameras`, in order, that can be among the k best of any ray of a bundle, or
/// determine the threshold of the k-th best. It bounds the penalties over the bundle, so excluding
/// the others changes no weight.
std::vector<int> select_candidate_cameras(const rig::Rig& rig, std::span<const int> cameras,
                                          const RayBundle& bundle, const RayWeightOptions& weighing,
                                          double spacing);

}  // namespace raystage::render
