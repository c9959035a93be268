// SPDX-License-Identifier: Apache-2.0
// Reads a file of triangles with Assimp. The transforms of nested nodes are applied to the
// positions, and their inverse transposes to the normals, in a second step that an animation
// repeats for each frame. Polygons are triangulated; points and lines are ignored. Each mesh of a
// node becomes an object. Metals (metallic factor of at least 0.5) become glossy, or mirrors if
// their roughness is below 0.05. Output: one mesh in the file's coordinates and units (FBX:
// metres). Cost: linear in vertices and triangles.
#include "compose/geometry/mesh.h"

#include <assimp/material.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>
#include <fmt/format.h>

#include <algorithm>
#include <assimp/Importer.hpp>
#include <cmath>
#include <map>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "compose/geometry/mesh_file_access.h"

namespace raystage::compose {
namespace {

constexpr float kMirrorRoughness = 0.05F;

using Eigen::Vector3d;

Vector3d vector_of(const aiVector3D& v) { return {double{v.x}, double{v.y}, double{v.z}}; }

/// Returns the file extension of image bytes that Textures can read from memory, or "".
std::string image_format_of(std::string_view bytes) {
  if (bytes.starts_with("\x89PNG")) return "png";
  if (bytes.starts_with("\xff\xd8\xff")) return "jpg";
  if (bytes.starts_with("\x76\x2f\x31\x01")) return "exr";
  return {};
}

/// Returns an image of the file; `index`: of it, by Assimp.
std::shared_ptr<const EmbeddedImage> embedded_image(const aiTexture& from, std::size_t index,
                                                    const std::filesystem::path& file) {
  EmbeddedImage image;
  const std::string name = from.mFilename.C_Str();
  image.name = fmt::format("{}#image {}{}", file.string(), index, name.empty() ? "" : " " + name);
  // Assimp states the size of a compressed image as its width, without a height.
  if (from.mHeight == 0 && from.pcData != nullptr) {
    image.bytes.assign(reinterpret_cast<const char*>(from.pcData), from.mWidth);
  }
  image.format = image_format_of(image.bytes);
  return std::make_shared<const EmbeddedImage>(std::move(image));
}

using ImageByTexture = std::map<const aiTexture*, std::shared_ptr<const EmbeddedImage>>;

Material material_from(const aiScene& scene, const aiMaterial& from,
                       const std::filesystem::path& file, ImageByTexture& images) {
  Material material;
  aiColor4D color;
  if (from.Get(AI_MATKEY_BASE_COLOR, color) == AI_SUCCESS ||
      from.Get(AI_MATKEY_COLOR_DIFFUSE, color) == AI_SUCCESS) {
    material.color = {color.r, color.g, color.b};
  }
  aiString texture;
  if ((from.GetTexture(aiTextureType_BASE_COLOR, 0, &texture) == AI_SUCCESS ||
       from.GetTexture(aiTextureType_DIFFUSE, 0, &texture) == AI_SUCCESS) &&
      texture.length > 0) {
    const auto [embedded, index] = scene.GetEmbeddedTextureAndIndex(texture.C_Str());
    if (embedded == nullptr) {
      material.texture = (file.parent_path() / texture.C_Str()).lexically_normal();
    } else {
      auto& image = images[embedded];
      if (!image) image = embedded_image(*embedded, static_cast<std::size_t>(index), file);
      material.embedded_texture = image;
    }
  }
  float metallic = 0, roughness = 1;
  from.Get(AI_MATKEY_METALLIC_FACTOR, metallic);
  from.Get(AI_MATKEY_ROUGHNESS_FACTOR, roughness);
  if (metallic >= 0.5F) {
    material.kind =
        roughness < kMirrorRoughness ? Material::Kind::kMirror : Material::Kind::kGlossy;
    material.roughness = std::max(roughness, 1e-3F);
  }
  return material;
}

bool is_emissive(const aiMaterial& from) {
  aiColor3D color;
  return from.GetTextureCount(aiTextureType_EMISSIVE) > 0 ||
         (from.Get(AI_MATKEY_COLOR_EMISSIVE, color) == AI_SUCCESS && !color.IsBlack());
}

[[noreturn]] void refuse_number(const std::filesystem::path& file) {
  throw Error::bad_input("the mesh has a vertex that is not finite", file.string(),
                         "Export it again");
}

Eigen::Affine3d transform_of(const aiMatrix4x4& m) {
  Eigen::Matrix4d matrix;
  matrix << m.a1, m.a2, m.a3, m.a4, m.b1, m.b2, m.b3, m.b4, m.c1, m.c2, m.c3, m.c4, 0, 0, 0, 1;
  return Eigen::Affine3d(matrix);
}

void add_vertices(const aiMesh& from, const std::filesystem::path& file, Mesh& mesh) {
  for (unsigned v = 0; v < from.mNumVertices; ++v) {
    mesh.positions.push_back(vector_of(from.mVertices[v]));
    if (from.HasNormals()) {
      const Vector3d normal = vector_of(from.mNormals[v]).stableNormalized();
      mesh.normals.push_back(Eigen::Vector3f::Zero());
      if (normal.allFinite()) mesh.normals.back() = normal.cast<float>();
    }
    if (from.HasTextureCoords(0)) {
      const aiVector3D& uv = from.mTextureCoords[0][v];
      if (!std::isfinite(uv.x) || !std::isfinite(uv.y)) refuse_number(file);
      mesh.uvs.emplace_back(uv.x, uv.y);
    }
  }
}

/// Adds a node, its meshes and its descendants.
void add_node(const aiScene& scene, const aiNode& node, const Eigen::Affine3d& file_from_parent,
              const std::filesystem::path& file, MeshFile& result) {
  Mesh& mesh = result.mesh;
  const std::size_t index = result.node_names.size();
  const Eigen::Affine3d file_from_node = file_from_parent * transform_of(node.mTransformation);
  result.node_names.emplace_back(node.mName.C_Str());
  result.file_from_node.push_back(file_from_node);
  for (unsigned i = 0; i < node.mNumMeshes; ++i) {
    const aiMesh& from = *scene.mMeshes[node.mMeshes[i]];
    result.is_deformable |= from.mNumBones > 0 || from.mNumAnimMeshes > 0;
    const std::size_t first = mesh.positions.size();
    // Fill in for meshes that have none.
    if (from.HasNormals()) mesh.normals.resize(first, Eigen::Vector3f::Zero());
    if (from.HasTextureCoords(0)) mesh.uvs.resize(first, Eigen::Vector2f::Zero());
    add_vertices(from, file, mesh);
    std::string name = node.mName.length > 0 ? node.mName.C_Str() : from.mName.C_Str();
    if (name.empty()) name = "object" + std::to_string(mesh.objects.size());
    mesh.objects.push_back({std::move(name), static_cast<int>(from.mMaterialIndex)});
    result.parts.push_back({first, mesh.positions.size() - first, index});
    const auto corner = static_cast<std::uint32_t>(first);
    for (unsigned f = 0; f < from.mNumFaces; ++f) {
      const aiFace& face = from.mFaces[f];
      if (face.mNumIndices != 3) continue;  // points and lines
      mesh.corners.push_back(
          {corner + face.mIndices[0], corner + face.mIndices[1], corner + face.mIndices[2]});
      mesh.triangle_objects.push_back(static_cast<std::uint32_t>(mesh.objects.size() - 1));
    }
  }
  for (unsigned i = 0; i < node.mNumChildren; ++i) {
    add_node(scene, *node.mChildren[i], file_from_node, file, result);
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

MeshFile read_mesh_file(const std::filesystem::path& file, bool applies_unit) {
  if (!std::filesystem::exists(file)) {
    throw Error::bad_input("the mesh file does not exist", file.string(),
                           "Correct the layer's path; it is relative to the shot's folder");
  }
  Assimp::Importer importer;
  importer.SetIOHandler(new MeshFileAccess(file));  // NOLINT: the importer deletes it
  unsigned steps = aiProcess_Triangulate | aiProcess_JoinIdenticalVertices | aiProcess_SortByPType;
  if (applies_unit) steps |= aiProcess_GlobalScale;
  const aiScene* scene = importer.ReadFile(file.string(), steps);
  if (scene == nullptr) {
    throw Error::bad_input(std::string("the mesh cannot be read: ") + importer.GetErrorString(),
                           file.string(), "Give a glTF, FBX, OBJ or PLY file");
  }
  MeshFile result;
  Mesh& mesh = result.mesh;
  ImageByTexture images;
  for (unsigned m = 0; m < scene->mNumMaterials; ++m) {
    result.is_emissive |= is_emissive(*scene->mMaterials[m]);
    mesh.materials.push_back(material_from(*scene, *scene->mMaterials[m], file, images));
  }
  if (mesh.materials.empty()) mesh.materials.emplace_back();
  add_node(*scene, *scene->mRootNode, Eigen::Affine3d::Identity(), file, result);
  result.is_animated = scene->mNumAnimations > 0;
  if (!mesh.normals.empty()) mesh.normals.resize(mesh.positions.size(), Eigen::Vector3f::Zero());
  if (!mesh.uvs.empty()) mesh.uvs.resize(mesh.positions.size(), Eigen::Vector2f::Zero());
  for (Mesh::Object& object : mesh.objects) {
    if (static_cast<std::size_t>(object.material) >= mesh.materials.size()) object.material = 0;
  }
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
