// SPDX-License-Identifier: Apache-2.0
// Reads a file of triangles. The transforms of nested nodes are applied to the
// positions, and their inverse transposes to the normals, in a second step that an animation
// repeats for each frame. Polygons are triangulated; points and lines are ignored. Each mesh of a
// node becomes an object. Metals (metallic factor of at least 0.5) become glossy, or mirrors if
// their roughness is below 0.05. Output: one mesh in the file's coordinates and units (FBX:
// metres). Cost: linear in vertices and triangles.
#include "compose/geometry/mesh.h"

#include <fmt/format.h>

#include <algorithm>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "meshes/node_transforms.h"

namespace raystage::compose {
namespace {

constexpr float kMirrorRoughness = 0.05F;

using Eigen::Vector3d;

/// Returns the file extension of image bytes that Textures can read from memory, or "".
std::string image_format_of(std::string_view bytes) {
  if (bytes.starts_with("\x89PNG")) return "png";
  if (bytes.starts_with("\xff\xd8\xff")) return "jpg";
  if (bytes.starts_with("\x76\x2f\x31\x01")) return "exr";
  return {};
}

using EmbeddedImages = std::vector<std::shared_ptr<const EmbeddedImage>>;

EmbeddedImages embedded_images(std::vector<meshes::DecodedScene::Image> images,
                               const std::filesystem::path& file) {
  EmbeddedImages result;
  for (meshes::DecodedScene::Image& from : images) {
    EmbeddedImage image;
    image.name = fmt::format("{}#image {}{}", file.string(), result.size(),
                             from.name.empty() ? "" : " " + from.name);
    image.bytes = std::move(from.bytes);
    image.format = image_format_of(image.bytes);
    result.push_back(std::make_shared<const EmbeddedImage>(std::move(image)));
  }
  return result;
}

/// Returns where a texture is that a mesh file names. Complete paths may lead below its folder,
/// too. The user's permission to follow links includes textures that are outside.
ContainedPath texture_below(const std::filesystem::path& folder, const std::string& name) {
  namespace fs = std::filesystem;
  const fs::path path = fs::absolute(folder / name).lexically_normal();
  if (permits_links() && path.has_filename()) return {path.parent_path(), path.filename()};
  return {folder, path.lexically_relative(fs::absolute(folder).lexically_normal())};
}

Material material_from(const meshes::DecodedScene::Material& from, const EmbeddedImages& images,
                       const std::filesystem::path& file) {
  Material material;
  material.color = Eigen::Vector3f(from.color.data());
  if (from.image != meshes::DecodedScene::kNone) {
    material.embedded_texture = images[from.image];
  } else if (!from.texture.empty()) {
    // A name without a folder is in the current one.
    const std::filesystem::path folder = file.parent_path().empty() ? "." : file.parent_path();
    material.texture = texture_below(folder, from.texture);
  }
  if (from.metallic >= 0.5F) {
    material.kind =
        from.roughness < kMirrorRoughness ? Material::Kind::kMirror : Material::Kind::kGlossy;
    material.roughness = std::max(from.roughness, 1e-3F);
  }
  return material;
}

[[noreturn]] void refuse_number(const std::filesystem::path& file) {
  throw Error::bad_input("the mesh has a vertex that is not finite", file.string(),
                         "Export it again");
}

void add_vertices(const meshes::DecodedScene::Mesh& from, Mesh& mesh) {
  for (const auto& position : from.positions) {
    mesh.positions.emplace_back(double{position[0]}, double{position[1]}, double{position[2]});
  }
  for (const auto& values : from.normals) {
    const Vector3d normal =
        Vector3d(double{values[0]}, double{values[1]}, double{values[2]}).stableNormalized();
    mesh.normals.push_back(Eigen::Vector3f::Zero());
    if (normal.allFinite()) mesh.normals.back() = normal.cast<float>();
  }
  for (const auto& uv : from.uvs) mesh.uvs.emplace_back(uv[0], uv[1]);
}

/// Adds a mesh of a node as an object.
void add_object(const meshes::DecodedScene::Mesh& from, const std::string& node_name,
                std::size_t node, MeshFile& result) {
  Mesh& mesh = result.mesh;
  result.is_deformable |= from.is_deformable;
  const std::size_t first = mesh.positions.size();
  // Fill in for meshes that have none.
  if (!from.normals.empty()) mesh.normals.resize(first, Eigen::Vector3f::Zero());
  if (!from.uvs.empty()) mesh.uvs.resize(first, Eigen::Vector2f::Zero());
  add_vertices(from, mesh);
  std::string name = node_name.empty() ? from.name : node_name;
  if (name.empty()) name = "object" + std::to_string(mesh.objects.size());
  mesh.objects.push_back({std::move(name), static_cast<int>(from.material)});
  result.parts.push_back({first, mesh.positions.size() - first, node});
  const auto corner = static_cast<std::uint32_t>(first);
  for (const auto& triangle : from.corners) {
    mesh.corners.push_back({corner + triangle[0], corner + triangle[1], corner + triangle[2]});
    mesh.triangle_objects.push_back(static_cast<std::uint32_t>(mesh.objects.size() - 1));
  }
}

}  // namespace

std::size_t Mesh::bytes() const {
  return positions.size() * sizeof(Eigen::Vector3d) + normals.size() * sizeof(Eigen::Vector3f) +
         uvs.size() * sizeof(Eigen::Vector2f) +
         corners.size() * (sizeof(corners[0]) + sizeof(triangle_objects[0]));
}

Mesh MeshFile::place(Mesh mesh, const std::vector<Part>& parts,
                     const std::vector<Eigen::Affine3d>& file_from_node,
                     const std::filesystem::path& file) {
  for (const Part& part : parts) {
    const Eigen::Affine3d& placed = file_from_node[part.node];
    const Eigen::Matrix3d of_normals = placed.linear().inverse().transpose();
    for (std::size_t i = part.first; i < part.first + part.count; ++i) {
      mesh.positions[i] = placed * mesh.positions[i];
      if (!mesh.positions[i].allFinite()) refuse_number(file);
      if (mesh.normals.empty()) continue;
      const Vector3d normal = (of_normals * mesh.normals[i].cast<double>()).stableNormalized();
      mesh.normals[i] =
          normal.allFinite() ? Eigen::Vector3f(normal.cast<float>()) : Eigen::Vector3f::Zero();
    }
  }
  return mesh;
}

MeshFile read_mesh_file(const std::filesystem::path& file, const meshes::DecodeOptions& options) {
  meshes::DecodedScene scene = meshes::decode_scene(file, options);
  MeshFile result;
  Mesh& mesh = result.mesh;
  const EmbeddedImages images = embedded_images(std::move(scene.images), file);
  for (const meshes::DecodedScene::Material& material : scene.materials) {
    result.is_emissive |= material.is_emissive;
    mesh.materials.push_back(material_from(material, images, file));
  }
  for (std::size_t n = 0; n < scene.nodes.size(); ++n) {
    const meshes::DecodedScene::Node& node = scene.nodes[n];
    result.node_names.push_back(node.name);
    for (const std::uint32_t index : node.meshes) {
      add_object(scene.meshes[index], node.name, n, result);
    }
  }
  result.file_from_node = meshes::file_from_nodes(scene);
  result.is_animated = scene.is_animated;
  if (!mesh.normals.empty()) mesh.normals.resize(mesh.positions.size(), Eigen::Vector3f::Zero());
  if (!mesh.uvs.empty()) mesh.uvs.resize(mesh.positions.size(), Eigen::Vector2f::Zero());
  if (mesh.corners.empty()) {
    throw Error::bad_input("the mesh has no triangle", file.string(), "Export it with its faces");
  }
  return result;
}

Mesh read_mesh(const std::filesystem::path& file) {
  MeshFile of_file = read_mesh_file(file);
  return MeshFile::place(std::move(of_file.mesh), of_file.parts, of_file.file_from_node, file);
}

}  // namespace raystage::compose
