// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <array>
#include <span>
#include <vector>

namespace raystage::simulate {

/// Triangles with a unit normal and texture coordinates at each corner; positions in metres.
struct SceneMesh {
  std::vector<Eigen::Vector3f> positions, normals;
  std::vector<Eigen::Vector2f> uvs;
  std::vector<std::array<unsigned, 3>> triangles;

  /// Appends `other`, transformed by `placement`; returns this mesh.
  SceneMesh& add(const SceneMesh& other,
                 const Eigen::Isometry3f& placement = Eigen::Isometry3f::Identity());
};

/// Returns a parallelogram of `cells` x `cells` parts; (u, v) run along its edges from 0 to
/// `uv_size`.
SceneMesh make_quad(const Eigen::Vector3f& corner, const Eigen::Vector3f& edge_u,
                    const Eigen::Vector3f& edge_v, const Eigen::Vector2f& uv_size = {1, 1},
                    int cells = 1);
/// Returns a sphere around the origin; u runs once around the y axis, v from the upper pole to the
/// lower.
SceneMesh make_sphere(float radius, int segments);
/// Returns a box around the origin; each face has the whole texture.
SceneMesh make_box(const Eigen::Vector3f& size);
/// Returns a torus in the plane z = 0 around the origin; u runs `turns` times along the ring, v
/// once around the tube.
SceneMesh make_torus(float ring_radius, float tube_radius, int ring_segments, int tube_segments,
                     float turns = 1);
/// Returns a round rod in pieces of at most 0.3 m, as long triangles slow down ray tracing.
SceneMesh make_rod(const Eigen::Vector3f& from, const Eigen::Vector3f& to, float radius,
                   int sides = 8);
/// Returns a truncated cone without caps around the y axis, its top at y = `height`, its bottom at
/// y = 0.
SceneMesh make_cone(float top_radius, float bottom_radius, float height, int sides);
/// Returns a folded cloth near the plane z = 0: x from 0 to `width`, y from 0 to `height`.
SceneMesh make_curtain(float width, float height, float depth, int folds);
/// Returns a wheel with rim, hub and spokes in the plane z = 0 around the origin.
SceneMesh make_wheel(float radius, float spoke_radius, int spokes);

}  // namespace raystage::simulate
