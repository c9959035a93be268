// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <numbers>

#include "compose/geometry/geometry_scene.h"

namespace raystage::testing {

inline compose::Material make_material(compose::Material::Kind kind, float color = 1) {
  compose::Material material;
  material.kind = kind;
  material.color.setConstant(color);
  return material;
}

/// Returns a square in the plane z = 0 that faces +z, x and y from -half to half.
inline compose::Mesh square(double half, const compose::Material& material) {
  compose::Mesh mesh;
  mesh.positions = {{-half, -half, 0}, {half, -half, 0}, {half, half, 0}, {-half, half, 0}};
  mesh.uvs = {{0, 0}, {1, 0}, {1, 1}, {0, 1}};
  mesh.corners = {{0, 1, 2}, {0, 2, 3}};
  mesh.triangle_objects = {0, 0};
  mesh.objects = {{"square", 0}};
  mesh.materials = {material};
  return mesh;
}

/// Returns a sphere around the origin with smooth normals.
inline compose::Mesh ball(double radius, const compose::Material& material, int steps = 48) {
  compose::Mesh mesh;
  for (int row = 0; row <= steps; ++row) {
    for (int column = 0; column <= 2 * steps; ++column) {
      const double polar = std::numbers::pi * row / steps, turn = std::numbers::pi * column / steps;
      const Eigen::Vector3d normal(std::sin(polar) * std::cos(turn), std::cos(polar),
                                   std::sin(polar) * std::sin(turn));
      mesh.positions.emplace_back(radius * normal);
      mesh.normals.emplace_back(normal.cast<float>());
    }
  }
  const auto at = [&](int row, int column) {
    return static_cast<std::uint32_t>(row * (2 * steps + 1) + column);
  };
  for (int row = 0; row < steps; ++row) {
    for (int column = 0; column < 2 * steps; ++column) {
      mesh.corners.push_back({at(row, column), at(row + 1, column), at(row + 1, column + 1)});
      mesh.corners.push_back({at(row, column), at(row + 1, column + 1), at(row, column + 1)});
    }
  }
  mesh.triangle_objects.assign(mesh.corners.size(), 0);
  mesh.objects = {{"ball", 0}};
  mesh.materials = {material};
  return mesh;
}

/// A PNG file of 16x16 pixels as base64 text: codes 200 left and 20 right in R, 128 in the upper
/// and 0 in the lower half in G, 255 in B.
inline constexpr const char* kQuarteredPng =
    "iVBORw0KGgoAAAANSUhEUgAAABAAAAAQCAIAAACQkWg2AAAAIUlEQVR42mM40fAfKxLBgRhGNdBGA8N/rEgEBxrV"
    "QBMNALubrRAtCRviAAAAAElFTkSuQmCC";

/// The same size with codes 200, 0, 0 and alpha 128 in the left and 0 in the right half.
inline constexpr const char* kTransparentPng =
    "iVBORw0KGgoAAAANSUhEUgAAABAAAAAQCAYAAAAf8/9hAAAAHElEQVR42mM4wcDQQAAz4MMMowaMGjBqwHAxAAAv"
    "wwgQzaBSnAAAAABJRU5ErkJggg==";

inline compose::MeshInstance make_instance(const compose::EmbreeMesh& scene,
                                           const Eigen::Vector3d& position, double scale = 1) {
  compose::MeshInstance mesh;
  mesh.scene = {std::shared_ptr<void>(), &scene};  // the test owns it
  mesh.world_from_object.translate(position).scale(scale);
  mesh.object_from_world = mesh.world_from_object.inverse();
  return mesh;
}

}  // namespace raystage::testing
