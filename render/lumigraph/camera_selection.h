// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include "render/lumigraph/ray_weights.h"

namespace raystage {

/// Rays from one eye through a rectangle of pixels, and how far away they end.
struct RayBundle {
  Eigen::Vector3d eye;
  std::array<Eigen::Vector3d, 4> corners;  ///< unit directions
  double min_inverse_distance = 0,
         max_inverse_distance = 0;  ///< 1 / distance of the points, per metre
};

/// Which of `cameras` can be among the k best of any ray of a bundle, or bear on the k-th best's
/// threshold: by bounds on the penalties over the bundle, so that leaving the others out changes no
/// weight. In the order given.
std::vector<int> select_candidate_cameras(const Rig& rig, std::span<const int> cameras,
                                          const RayBundle& bundle,
                                          const RayWeightSettings& weighing, double spacing);

}  // namespace raystage
