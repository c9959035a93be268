// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace raystage {

/// How a surface answers light.
struct Material {
  enum class Kind {
    kDiffuse,  ///< Lambert: the same brightness from everywhere
    kMirror,   ///< the ray's reflection, times the colour
    kGlossy    ///< reflections around it: GGX (Walter et al. 2007), sampled by visible normals
  };
  Kind kind = Kind::kDiffuse;
  Eigen::Vector3f color{0.8F, 0.8F,
                        0.8F};         ///< scene-linear, in the working space; times the texture
  std::filesystem::path texture = {};  ///< empty: none
  float roughness = 0.2F;              ///< of kGlossy: GGX' alpha is its square; (0, 1]
};

/// Triangles in their own frame, units of the file (metres, unless the shot scales them).
struct Mesh {
  struct Object {
    std::string name;
    int material = 0;
  };
  std::vector<Eigen::Vector3d> positions;
  std::vector<Eigen::Vector3f> normals;  ///< of each position, unit; empty: faces' own
  std::vector<Eigen::Vector2f> uvs;      ///< of each position, (0, 0) lower left; empty: none
  std::vector<std::array<std::uint32_t, 3>> corners;  ///< of each triangle
  std::vector<std::uint32_t> triangle_objects;        ///< of each triangle
  std::vector<Object> objects;
  std::vector<Material> materials;

  std::size_t bytes() const;
};

/// Any format that Assimp reads: glTF 2, OBJ, PLY ... Textures' paths are relative to it in the
/// file, and whole here. Metal of glTF becomes glossy, or a mirror where its roughness is below
/// 0.05. Throws Error (bad input) where there is no such file, no triangle in it, or a number that
/// is not finite.
Mesh read_mesh(const std::filesystem::path& file);

}  // namespace raystage
