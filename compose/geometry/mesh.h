// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <string>
#include <vector>

namespace raystage::compose {

/// How a surface reflects light.
struct Material {
  enum class Kind {
    kDiffuse,  ///< Lambert
    kMirror,   ///< perfect reflection, times the colour
    kGlossy    ///< rough reflection: GGX (Walter et al. 2007), sampled by visible normals
  };
  Kind kind = Kind::kDiffuse;
  /// Scene-linear, in the working space; times the texture.
  Eigen::Vector3f color{0.8F, 0.8F, 0.8F};
  std::filesystem::path texture = {};  ///< empty: none
  float roughness = 0.2F;              ///< of kGlossy, (0, 1]; alpha of GGX is its square
};

/// Triangles in object coordinates, units of the file (metres, unless the shot scales them).
struct Mesh {
  struct Object {
    std::string name;
    int material = 0;
  };
  std::vector<Eigen::Vector3d> positions;
  std::vector<Eigen::Vector3f> normals;  ///< of each position, unit; empty: flat shading
  std::vector<Eigen::Vector2f> uvs;      ///< of each position, (0, 0) lower left; empty: none
  std::vector<std::array<std::uint32_t, 3>> corners;  ///< of each triangle
  std::vector<std::uint32_t> triangle_objects;        ///< of each triangle
  std::vector<Object> objects;
  std::vector<Material> materials;

  std::size_t bytes() const;
};

/// Reads a mesh in any format that Assimp reads: glTF 2, OBJ, PLY ... Texture paths are joined with
/// the file's folder. Metals of glTF become glossy, or mirrors below a roughness of 0.05. Throws
/// Error (bad input) if the file is missing, has no triangle, or has a number that is not finite.
Mesh read_mesh(const std::filesystem::path& file);

}  // namespace raystage::compose
