// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>

#include "render/lumigraph/ray_chunk.h"

namespace raystage::render {

/// Unit directions of adjacent rays, in the world.
struct RayDirections {
  int count = 0;
  alignas(64) std::array<std::array<double, RayChunk::kSize>, 3> direction{};

  Eigen::Vector3d operator[](int i) const {
    return {direction[0][i], direction[1][i], direction[2][i]};
  }
};

/// Computes the rays through the centres of `count` pixels (at most RayChunk::kSize) of a view's
/// row y, from pixel x on. `ray_from_pixel`: world_ray_from_pixel(). Run-time dispatch, as below.
void compute_ray_directions(const Eigen::Matrix3d& ray_from_pixel, int x, int y, int count,
                            RayDirections& row);

/// Fills a chunk, as the fill_chunk() of ray_chunk.h, with the row's rays from one eye.
void fill_chunk(const Eigen::Vector3d& eye, const RayDirections& row,
                std::span<const double> inverse_distance, const Eigen::Vector3d& middle,
                RayChunk& chunk);

}  // namespace raystage::render
