// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <cstddef>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <vector>

#include "base/contained_path.h"
#include "meshes/scene_decoder.h"

namespace raystage::compose {

/// An image inside a mesh file.
struct EmbeddedImage {
  std::string name;    ///< of the mesh file and the image in it, for errors
  std::string format;  ///< extension of such a file: "png", "jpg", "exr"; empty: another one
  std::string bytes;   ///< as in such a file
};

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
  ContainedPath texture = {};  ///< relative.empty(): none
  float roughness = 0.2F;      ///< of kGlossy, (0, 1]; alpha of GGX is its square
  /// Whether the shot names the texture, which may be anywhere then. Those that the mesh file names
  /// are only read below its folder.
  bool is_texture_of_shot = false;
  std::shared_ptr<const EmbeddedImage> embedded_texture = {};  ///< instead of `texture`; or null
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

/// A mesh whose objects are not placed yet: each has the coordinates of its node in the file.
struct MeshFile {
  struct Part {
    std::size_t first = 0, count = 0;  ///< positions of an object
    std::size_t node = 0;
  };
  Mesh mesh;
  std::vector<Part> parts;  ///< of each object
  /// Names and transforms, without animation, of the nodes in depth-first order.
  std::vector<std::string> node_names;
  std::vector<Eigen::Affine3d> file_from_node;
  bool is_animated = false;    ///< whether the file has animations
  bool is_deformable = false;  ///< whether bones or morph targets deform a mesh
  bool is_emissive = false;    ///< whether a material emits light, which is not read

  /// Returns the mesh in the file's coordinates. `file_from_node`: of each node. `file`: named by
  /// errors. Throws Error (bad input) if a number is not finite.
  static Mesh place(Mesh mesh, const std::vector<Part>& parts,
                    const std::vector<Eigen::Affine3d>& file_from_node,
                    const std::filesystem::path& file);
};

/// Reads a mesh in any format that Assimp reads: glTF 2, FBX, OBJ, PLY ... Texture paths are
/// relative to the file's folder; PNG, JPEG and EXR textures may be in the file. Metals of glTF
/// become glossy, or mirrors below a roughness of 0.05. Throws Error as meshes::decode_scene(), and
/// (bad input) if there is no triangle.
MeshFile read_mesh_file(const std::filesystem::path& file,
                        const meshes::DecodeOptions& options = {});

/// Reads a mesh as read_mesh_file() does, and places its objects as they are without animation.
Mesh read_mesh(const std::filesystem::path& file);

}  // namespace raystage::compose
