// SPDX-License-Identifier: Apache-2.0
// Makes the meshes of the simulated scenes as samples of parametric surfaces (u, v) on a regular
// grid, two triangles per cell, with exact normals. Positions are in metres.
#include "simulate/mesh.h"

#include <algorithm>
#include <cmath>
#include <functional>
#include <numbers>

namespace raystage::simulate {
namespace {

using Eigen::Vector2f;
using Eigen::Vector3f;

struct MeshPoint {
  Vector3f position, normal;
  Vector2f uv;
};

// Samples `surface`, a function on [0, 1]^2, at (columns + 1) x (rows + 1) points.
SceneMesh make_surface(int columns, int rows,
                       const std::function<MeshPoint(float, float)>& surface) {
  SceneMesh mesh;
  for (int row = 0; row <= rows; ++row) {
    for (int column = 0; column <= columns; ++column) {
      const MeshPoint point = surface(static_cast<float>(column) / static_cast<float>(columns),
                                      static_cast<float>(row) / static_cast<float>(rows));
      mesh.positions.push_back(point.position);
      mesh.normals.push_back(point.normal);
      mesh.uvs.push_back(point.uv);
    }
  }
  const auto stride = static_cast<unsigned>(columns + 1);
  for (unsigned row = 0; row < static_cast<unsigned>(rows); ++row) {
    for (unsigned column = 0; column < static_cast<unsigned>(columns); ++column) {
      const unsigned a = row * stride + column, b = a + 1, c = a + stride, d = c + 1;
      mesh.triangles.push_back({a, c, b});
      mesh.triangles.push_back({b, c, d});
    }
  }
  return mesh;
}

}  // namespace

SceneMesh& SceneMesh::add(const SceneMesh& other, const Eigen::Isometry3f& placement) {
  const auto first = static_cast<unsigned>(positions.size());
  for (const Vector3f& p : other.positions) positions.push_back(placement * p);
  for (const Vector3f& n : other.normals) normals.push_back(placement.linear() * n);
  uvs.insert(uvs.end(), other.uvs.begin(), other.uvs.end());
  for (const auto& t : other.triangles) {
    triangles.push_back({t[0] + first, t[1] + first, t[2] + first});
  }
  return *this;
}

SceneMesh make_quad(const Vector3f& corner, const Vector3f& edge_u, const Vector3f& edge_v,
                    const Vector2f& uv_size, int cells) {
  const Vector3f normal = edge_u.cross(edge_v).normalized();
  return make_surface(cells, cells, [&](float u, float v) {
    return MeshPoint{corner + edge_u * u + edge_v * v, normal, {uv_size.x() * u, uv_size.y() * v}};
  });
}

SceneMesh make_sphere(float radius, int segments) {
  return make_surface(segments, segments / 2, [&](float u, float v) {
    const float around = 2 * std::numbers::pi_v<float> * u, down = std::numbers::pi_v<float> * v;
    const Vector3f normal(std::sin(down) * std::cos(around), std::cos(down),
                          std::sin(down) * std::sin(around));
    return MeshPoint{radius * normal, normal, {u, v}};
  });
}

SceneMesh make_box(const Vector3f& size) {
  SceneMesh mesh;
  for (int axis = 0; axis < 3; ++axis) {
    for (const float side : {-0.5F, 0.5F}) {
      // Textures are upright on the side faces.
      const int up = axis == 1 ? 2 : 1;
      const int across = 3 - axis - up;
      Vector3f corner = Vector3f::Zero(), u = Vector3f::Zero(), v = Vector3f::Zero();
      corner(axis) = side * size(axis);
      // u runs to the right as seen from outside.
      const bool forwards = axis == 0 ? side < 0 : side > 0;
      corner(across) = (forwards ? -0.5F : 0.5F) * size(across);
      u(across) = (forwards ? 1.0F : -1.0F) * size(across);
      corner(up) = 0.5F * size(up);
      v(up) = -size(up);
      SceneMesh face = make_quad(corner, u, v);
      const Vector3f outward = side * 2 * Vector3f::Unit(axis);
      for (Vector3f& normal : face.normals) normal = outward;
      mesh.add(face);
    }
  }
  return mesh;
}

SceneMesh make_torus(float ring_radius, float tube_radius, int ring_segments, int tube_segments,
                     float turns) {
  return make_surface(ring_segments, tube_segments, [&](float u, float v) {
    const float along = 2 * std::numbers::pi_v<float> * u,
                around = 2 * std::numbers::pi_v<float> * v;
    const Vector3f outward(std::cos(along), std::sin(along), 0);
    const Vector3f normal = outward * std::cos(around) + Vector3f::UnitZ() * std::sin(around);
    return MeshPoint{ring_radius * outward + tube_radius * normal, normal, {turns * u, v}};
  });
}

SceneMesh make_rod(const Vector3f& from, const Vector3f& to, float radius, int sides) {
  const Vector3f along = to - from;
  const Vector3f axis = along.normalized();
  const Vector3f a = axis.unitOrthogonal(), b = axis.cross(a);
  const int pieces = std::max(1, static_cast<int>(std::ceil(along.norm() / 0.3F)));
  return make_surface(sides, pieces, [&](float u, float v) {
    const float around = 2 * std::numbers::pi_v<float> * u;
    const Vector3f normal = a * std::cos(around) + b * std::sin(around);
    return MeshPoint{from + along * v + radius * normal, normal, {u, v}};
  });
}

SceneMesh make_cone(float top_radius, float bottom_radius, float height, int sides) {
  return make_surface(sides, 1, [&](float u, float v) {
    const float around = 2 * std::numbers::pi_v<float> * u;
    const float radius = top_radius + (bottom_radius - top_radius) * v;
    const Vector3f outward(std::cos(around), 0, std::sin(around));
    const Vector3f normal =
        (outward * height + Vector3f::UnitY() * (bottom_radius - top_radius)).normalized();
    return MeshPoint{outward * radius + Vector3f::UnitY() * (height * (1 - v)), normal, {u, v}};
  });
}

SceneMesh make_curtain(float width, float height, float depth, int folds) {
  const float rate = 2 * std::numbers::pi_v<float> * static_cast<float>(folds) / width;
  return make_surface(folds * 16, 8, [&](float u, float v) {
    const float x = u * width;
    // The sum of two waves makes all folds different.
    const float z = depth * (std::sin(rate * x) + 0.35F * std::sin(0.37F * rate * x + 1));
    const float slope =
        depth * rate * (std::cos(rate * x) + 0.35F * 0.37F * std::cos(0.37F * rate * x + 1));
    return MeshPoint{
        {x, height * (1 - v), z}, Vector3f(-slope, 0, 1).normalized(), {x, height * v}};
  });
}

SceneMesh make_wheel(float radius, float spoke_radius, int spokes) {
  SceneMesh mesh = make_torus(radius, 2.5F * spoke_radius, 96, 10, 24);
  mesh.add(make_torus(0.06F * radius, 0.05F * radius, 24, 12));
  for (int i = 0; i < spokes; ++i) {
    const float angle =
        2 * std::numbers::pi_v<float> * static_cast<float>(i) / static_cast<float>(spokes);
    // Spokes are tangential to the hub on alternating sides, as on a bicycle.
    const float turn = angle + (i % 2 == 0 ? 0.9F : -0.9F);
    const float side = i % 2 == 0 ? 0.03F : -0.03F;
    mesh.add(make_rod(0.08F * radius * Vector3f(std::cos(turn), std::sin(turn), side / 0.08F),
                      radius * Vector3f(std::cos(angle), std::sin(angle), 0), spoke_radius, 6));
  }
  return mesh;
}

}  // namespace raystage::simulate
