// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "simulate/texture.h"

namespace raystage::simulate {

/// Return the textures of the built-in scenes: linear light R, G, B at (u, v), see
/// ProceduralTexture. All except backdrop, poster and chart are periodic.
Eigen::Vector3f paint_backdrop(float u, float v);  ///< evening landscape with houses
Eigen::Vector3f paint_floor(float u, float v);     ///< 2x2 squares of wooden boards
Eigen::Vector3f paint_velvet(float u, float v);    ///< red cloth with a gold pattern
Eigen::Vector3f paint_wallpaper(float u, float v);
Eigen::Vector3f paint_poster(float u, float v);  ///< lines of shapes like letters
Eigen::Vector3f paint_beach_ball(float u, float v);
Eigen::Vector3f paint_dotted_ball(float u, float v);
Eigen::Vector3f paint_marble(float u, float v);
Eigen::Vector3f paint_crate(float u, float v);
Eigen::Vector3f paint_twist(float u, float v);  ///< stripes that wind around a torus
Eigen::Vector3f paint_chart(float u, float v);  ///< large and small squares with random greys

}  // namespace raystage::simulate
