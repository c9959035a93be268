// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <span>
#include <vector>

namespace raystage {

/// Triangles with a normal (unit) and texture coordinates at each corner; metres.
struct SceneMesh {
  std::vector<Eigen::Vector3f> positions, normals;
  std::vector<Eigen::Vector2f> uvs;
  std::vector<std::array<unsigned, 3>> triangles;

  /// Adds another mesh, moved.
  SceneMesh& add(const SceneMesh& other,
                 const Eigen::Isometry3f& placement = Eigen::Isometry3f::Identity());
};

/// A parallelogram; (u, v) run along the edges from 0 to `uv_size`, in `cells` x `cells` parts.
SceneMesh make_quad(const Eigen::Vector3f& corner, const Eigen::Vector3f& edge_u,
                    const Eigen::Vector3f& edge_v, const Eigen::Vector2f& uv_size = {1, 1},
                    int cells = 1);
/// Around the origin, axis y; u once around, v from the upper pole to the lower.
SceneMesh make_sphere(float radius, int segments);
/// Around the origin; each face has the whole texture.
SceneMesh make_box(const Eigen::Vector3f& size);
/// Around the origin, axis z; u `turns` times along the ring, v once around the tube.
SceneMesh make_torus(float ring_radius, float tube_radius, int ring_segments, int tube_segments,
                     float turns = 1);
/// A round rod in pieces of at most 0.3 m, which a bounding volume hierarchy likes better.
SceneMesh make_rod(const Eigen::Vector3f& from, const Eigen::Vector3f& to, float radius,
                   int sides = 8);
/// A cone's side around the y axis, from `top_radius` at y = height to `bottom_radius` at y = 0.
SceneMesh make_cone(float top_radius, float bottom_radius, float height, int sides);
/// Cloth hanging in the plane z = 0 from y = height down to 0, x from 0 to width, in folds.
SceneMesh make_curtain(float width, float height, float depth, int folds);
/// A wheel in the plane z = 0 around the origin: rim, hub and spokes.
SceneMesh make_wheel(float radius, float spoke_radius, int spokes);

}  // namespace raystage
