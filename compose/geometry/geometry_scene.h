// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <vector>

#include "compose/geometry/lights.h"
#include "compose/geometry/surface_point.h"
#include "compose/layers/layer_image.h"

namespace raystage {

/// The geometry of a shot at a frame, and what lights it.
struct GeometryScene {
  std::vector<MeshInstance> meshes;
  const Textures* textures = nullptr;
  Lights lights;
};

/// What a mesh of the scene shows to a camera, which must not distort: `samples` rays a pixel (a
/// square number), in a grid. The others throw shadows on it, and are seen in it. A: the part of
/// the rays that hit it; Z, `P` (world, metres) and `N` (shading normal, world) of the nearest of
/// these; `albedo`: their mean. The same bytes for any number of threads, except for what
/// `lights.environment_radiance` does.
/// `ids`: of the mesh's objects, for LayerImage::ids; empty: none are told.
LayerImage render_geometry(const GeometryScene& scene, std::size_t mesh,
                           const VirtualCamera& camera, int samples,
                           std::span<const float> ids = {});

}  // namespace raystage
