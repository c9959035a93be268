// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <memory>
#include <span>

#include "compose/geometry/embree_mesh.h"
#include "compose/geometry/textures.h"

namespace raystage::compose {

/// How an object of a mesh is moved from one frame to the adjacent ones, in the world.
struct ObjectMotion {
  Eigen::Affine3d before_from_now = Eigen::Affine3d::Identity();
  Eigen::Affine3d after_from_now = Eigen::Affine3d::Identity();
};

/// A mesh with its transform at a frame.
struct MeshInstance {
  std::shared_ptr<const EmbreeMesh> scene;
  std::span<const Textures::Handle> textures;  ///< of each of its materials; null: none
  Eigen::Affine3d world_from_object = Eigen::Affine3d::Identity();
  Eigen::Affine3d object_from_world = Eigen::Affine3d::Identity();
  std::vector<ObjectMotion> motion = {};  ///< of each of its objects; empty: not known
};

/// A point of a surface that a ray hit.
struct SurfacePoint {
  Eigen::Vector3d position;          ///< world, metres
  Eigen::Vector3d normal;            ///< shading normal, unit, world, on the ray's side
  Eigen::Vector3d geometric_normal;  ///< of the triangle, on the same side
  const Material* material = nullptr;
  std::uint32_t object = 0;
  Eigen::Vector3f color;  ///< the material's, times its texture
};

/// Returns the surface at a hit. `spread` (radians) and `distance`, the length of the path before
/// this ray (metres), determine the texture filter's width.
SurfacePoint surface_point_at(const MeshInstance& mesh, const Textures* textures,
                              const render::WorldRay& ray, const SurfaceHit& hit, double spread,
                              double distance);

}  // namespace raystage::compose
