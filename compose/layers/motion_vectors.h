// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>

#include "compose/exr/exr_header.h"
#include "compose/layers/layer_image.h"

namespace raystage::compose {

/// A point of a scene in three successive frames: x, y, z, 1 in the world, metres, or a direction
/// to a point at infinity with 0.
struct MovingPoint {
  Eigen::Vector4d before, now, after;
};

/// Returns how far a point moves in the picture, pixels, x to the right and y upwards: where it was
/// in the frame before relative to where it is (X, Y), and where it is relative to where it will be
/// (Z, W), as the vector pass of Blender. 0 in a frame in which it is not in front of the camera.
std::array<float, 4> motion_vector(const render::VirtualCamera& view, const AdjacentViews& adjacent,
                                   const MovingPoint& point);

/// Returns the AOV `motion` with 0 in all pixels.
Aov empty_motion_aov(std::size_t pixels);

/// Adds the AOV `motion` of an image whose points stand still in the world, at the depths of its
/// pixels: that of the camera. Without a depth a point is at infinity, and without alpha there is
/// none.
void add_camera_motion(const render::VirtualCamera& view, const AdjacentViews& adjacent,
                       LayerImage& image);

}  // namespace raystage::compose
