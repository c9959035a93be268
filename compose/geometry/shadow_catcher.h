// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "compose/geometry/geometry_scene.h"
#include "compose/layers/layer_image.h"

namespace raystage {

/// How what a light field shows receives the shadows of geometry.
struct ShadowCatcher {
  double strength = 1;  ///< 0: none; 1: all the light that is taken away
  double reach = 0.5;   ///< metres within which meshes take away light that comes from everywhere
  int rays = 64;        ///< a pixel, for that; 0: it is not taken away
};

/// Darkens a light field's picture where the scene's meshes stand between the surface that it was
/// looked up on (LayerImage::z, the method's proxy) and the light: by the share of `lights.ambient`
/// and of the directional lights, each as on a surface that faces it, that does not arrive.
/// Ambient light is that of a half-space of which the meshes cover what they cover of all
/// directions, twice, so that nothing need be known of the surface's normal. Alpha stays; pixels
/// without a depth and those out of reach of every mesh and shadow keep their bytes. The same bytes
/// for any number of threads.
void apply_shadow_catcher(const GeometryScene& scene, const VirtualCamera& camera,
                          const ShadowCatcher& catcher, LayerImage& image);

}  // namespace raystage
