// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <atomic>
#include <cstddef>
#include <cstdint>
#include <optional>
#include <vector>

#include "compose/exr/exr_header.h"
#include "compose/geometry/lights.h"
#include "compose/geometry/surface_point.h"
#include "compose/layers/layer_image.h"

namespace raystage::compose {

/// Geometry and lights of a shot at a frame.
struct GeometryScene {
  std::vector<MeshInstance> meshes;
  const Textures* textures = nullptr;
  Lights lights;
  /// Unit direction from which diffuse surfaces are lit with radiance 1, without shadows, in shots
  /// that have no lights: towards the camera. Light fields receive no shadows of it.
  std::optional<Eigen::Vector3d> headlight = {};
  /// Receives the time that all threads spend in render_geometry(), nanoseconds; null: not
  /// measured.
  std::atomic<std::int64_t>* busy_ns = nullptr;
};

/// Returns one mesh of the scene as `camera` (without distortion) sees it, with `samples` rays per
/// pixel (a square number) in a grid. The other meshes cast shadows on it and appear in its
/// reflections. A: share of the rays that hit it; Z, `P` (world, metres) and `N` (shading normal,
/// world): of the nearest hit; `albedo`: mean over the hits. `ids`: of the mesh's objects, for
/// LayerImage::ids; empty: not requested. `adjacent`: adds the AOV `motion` of the nearest hit;
/// null: not requested. The bytes do not depend on the number of threads, unless those of
/// `lights.environment_radiance` do.
LayerImage render_geometry(const GeometryScene& scene, std::size_t mesh,
                           const render::VirtualCamera& camera, int samples,
                           std::span<const float> ids = {},
                           const AdjacentViews* adjacent = nullptr);

}  // namespace raystage::compose
