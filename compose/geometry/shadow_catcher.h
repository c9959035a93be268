// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "compose/geometry/geometry_scene.h"
#include "compose/layers/layer_image.h"

namespace raystage::compose {

/// How a light field receives the shadows of geometry.
struct ShadowCatcher {
  double strength = 1;  ///< 0: no shadows; 1: all occluded light is removed
  double reach = 0.5;   ///< metres within which meshes occlude ambient light
  int rays = 64;        ///< per pixel, for ambient occlusion; 0: none
};

/// Darkens a light field's picture where meshes are between its surface (LayerImage::z, the
/// method's proxy) and the lights. The factor is the share of `lights.ambient` and of the
/// direct lights that is not occluded, each as on a surface that faces it; edges are smooth. The
/// normal of the surface is unknown: ambient occlusion is twice the share of all directions that
/// the meshes cover, at most 1. Alpha, pixels without depth and unshadowed pixels are kept. The
/// bytes do not depend on the number of threads.
void apply_shadow_catcher(const GeometryScene& scene, const render::VirtualCamera& camera,
                          const ShadowCatcher& catcher, LayerImage& image);

}  // namespace raystage::compose
