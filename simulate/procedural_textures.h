// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "simulate/texture.h"

namespace raystage {

/// The pictures of the built-in scenes. All but the backdrop, the poster and the chart repeat
/// without a seam.
Eigen::Vector3f paint_backdrop(float u, float v);  ///< evening landscape with a village
Eigen::Vector3f paint_floor(float u, float v);     ///< 2x2 checks of boards
Eigen::Vector3f paint_velvet(float u, float v);    ///< red cloth with a gold pattern
Eigen::Vector3f paint_wallpaper(float u, float v);
Eigen::Vector3f paint_poster(float u, float v);  ///< lines of something like letters
Eigen::Vector3f paint_beach_ball(float u, float v);
Eigen::Vector3f paint_dotted_ball(float u, float v);
Eigen::Vector3f paint_marble(float u, float v);
Eigen::Vector3f paint_crate(float u, float v);
Eigen::Vector3f paint_twist(float u, float v);  ///< stripes that wind around a torus
Eigen::Vector3f paint_chart(float u, float v);  ///< large and small checks, every cell its own grey

}  // namespace raystage
