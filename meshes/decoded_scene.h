// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <string>
#include <vector>

namespace raystage::meshes {

/// What a file of meshes contains, as far as renderers need it. All indices are in range, all
/// numbers of positions, texture coordinates and materials finite. Units: those of the file; FBX:
/// metres unless DecodeOptions say otherwise.
struct DecodedScene {
  static constexpr std::uint32_t kNone = 0xFFFFFFFF;

  /// Nodes in depth-first order: parents precede their children.
  struct Node {
    std::string name;
    std::uint32_t parent = kNone;  ///< index; kNone: the root
    std::array<float, 12> parent_from_node{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0};  ///< 3x4 by rows
    std::vector<std::uint32_t> meshes;                                           ///< indices
  };
  struct Mesh {
    std::string name;
    std::uint32_t material = 0;
    bool is_deformable = false;  ///< by bones or morph targets
    std::vector<std::array<float, 3>> positions;
    std::vector<std::array<float, 3>> normals;          ///< of each position, or empty
    std::vector<std::array<float, 2>> uvs;              ///< of each position, or empty
    std::vector<std::array<std::uint32_t, 3>> corners;  ///< of each triangle
  };
  struct Material {
    std::array<float, 3> color{0.8F, 0.8F, 0.8F};  ///< scene-linear Rec.709
    float metallic = 0, roughness = 1;
    bool is_emissive = false;
    std::string texture;          ///< path as in the file; empty: none, or an image
    std::uint32_t image = kNone;  ///< index
  };
  struct Image {
    std::string name;
    std::string bytes;  ///< of an image file; empty: it has another form
  };
  std::vector<Node> nodes;
  std::vector<Mesh> meshes;
  std::vector<Material> materials;
  std::vector<Image> images;
  bool is_animated = false;
};

}  // namespace raystage::meshes
