// SPDX-License-Identifier: Apache-2.0
// Reads a file of triangles with Assimp. The transforms of nested nodes are applied to the
// positions, and their inverse transposes to the normals. Polygons are triangulated; points and
// lines are ignored. Each mesh of a node becomes an object. Metals (metallic factor of at least
// 0.5) become glossy, or mirrors if their roughness is below 0.05. Output: one mesh in the file's
// coordinates and units. Cost: linear in vertices and triangles.
#include "compose/geometry/mesh.h"

#include <assimp/material.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <assimp/Importer.hpp>
#include <cmath>

#include "base/error.h"

namespace raystage::compose {
namespace {

constexpr float kMirrorRoughness = 0.05F;

Eigen::Vector3d vector_of(const aiVector3D& v) { return {double{v.x}, double{v.y}, double{v.z}}; }

Material material_from(const aiMaterial& from, const std::filesystem::path& folder) {
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
    material.texture = (folder / texture.C_Str()).lexically_normal();
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

[[noreturn]] void refuse_number(const std::filesystem::path& file) {
  throw Error::bad_input("the mesh has a vertex that is not finite", file.string(),
                         "Export it again");
}

Eigen::Affine3d transform_of(const aiMatrix4x4& m) {
  Eigen::Matrix4d matrix;
  matrix << m.a1, m.a2, m.a3, m.a4, m.b1, m.b2, m.b3, m.b4, m.c1, m.c2, m.c3, m.c4, 0, 0, 0, 1;
  return Eigen::Affine3d(matrix);
}

void add_vertices(const aiMesh& from, const Eigen::Affine3d& placed,
                  const std::filesystem::path& file, Mesh& mesh) {
  const Eigen::Matrix3d of_normals = placed.linear().inverse().transpose();
  for (unsigned v = 0; v < from.mNumVertices; ++v) {
    mesh.positions.push_back(placed * vector_of(from.mVertices[v]));
    if (!mesh.positions.back().allFinite()) refuse_number(file);
    if (from.HasNormals()) {
      const Eigen::Vector3d normal = (of_normals * vector_of(from.mNormals[v])).stableNormalized();
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

/// Adds the meshes of a node and of its descendants in file coordinates.
void add_node(const aiScene& scene, const aiNode& node, const Eigen::Affine3d& placed_above,
              const std::filesystem::path& file, Mesh& mesh) {
  const Eigen::Affine3d placed = placed_above * transform_of(node.mTransformation);
  for (unsigned i = 0; i < node.mNumMeshes; ++i) {
    const aiMesh& from = *scene.mMeshes[node.mMeshes[i]];
    const auto first = static_cast<std::uint32_t>(mesh.positions.size());
    // Fill in for meshes that have none.
    if (from.HasNormals()) mesh.normals.resize(first, Eigen::Vector3f::Zero());
    if (from.HasTextureCoords(0)) mesh.uvs.resize(first, Eigen::Vector2f::Zero());
    add_vertices(from, placed, file, mesh);
    std::string name = node.mName.length > 0 ? node.mName.C_Str() : from.mName.C_Str();
    if (name.empty()) name = "object" + std::to_string(mesh.objects.size());
    mesh.objects.push_back({std::move(name), static_cast<int>(from.mMaterialIndex)});
    for (unsigned f = 0; f < from.mNumFaces; ++f) {
      const aiFace& face = from.mFaces[f];
      if (face.mNumIndices != 3) continue;  // points and lines
      mesh.corners.push_back(
          {first + face.mIndices[0], first + face.mIndices[1], first + face.mIndices[2]});
      mesh.triangle_objects.push_back(static_cast<std::uint32_t>(mesh.objects.size() - 1));
    }
  }
  for (unsigned i = 0; i < node.mNumChildren; ++i) {
    add_node(scene, *node.mChildren[i], placed, file, mesh);
  }
}

}  // namespace

std::size_t Mesh::bytes() const {
  return positions.size() * sizeof(Eigen::Vector3d) + normals.size() * sizeof(Eigen::Vector3f) +
         uvs.size() * sizeof(Eigen::Vector2f) +
         corners.size() * (sizeof(corners[0]) + sizeof(triangle_objects[0]));
}

Mesh read_mesh(const std::filesystem::path& file) {
  if (!std::filesystem::exists(file)) {
    throw Error::bad_input("the mesh file does not exist", file.string(),
                           "Correct the layer's path; it is relative to the shot's folder");
  }
  Assimp::Importer importer;
  const aiScene* scene =
      importer.ReadFile(file.string(), aiProcess_Triangulate | aiProcess_JoinIdenticalVertices |
                                           aiProcess_SortByPType);
  if (scene == nullptr) {
    throw Error::bad_input(std::string("the mesh cannot be read: ") + importer.GetErrorString(),
                           file.string(), "Give a glTF, OBJ or PLY file");
  }
  Mesh mesh;
  for (unsigned m = 0; m < scene->mNumMaterials; ++m) {
    mesh.materials.push_back(material_from(*scene->mMaterials[m], file.parent_path()));
  }
  if (mesh.materials.empty()) mesh.materials.emplace_back();
  add_node(*scene, *scene->mRootNode, Eigen::Affine3d::Identity(), file, mesh);
  if (!mesh.normals.empty()) mesh.normals.resize(mesh.positions.size(), Eigen::Vector3f::Zero());
  if (!mesh.uvs.empty()) mesh.uvs.resize(mesh.positions.size(), Eigen::Vector2f::Zero());
  for (Mesh::Object& object : mesh.objects) {
    if (static_cast<std::size_t>(object.material) >= mesh.materials.size()) object.material = 0;
  }
  if (mesh.corners.empty()) {
    throw Error::bad_input("the mesh has no triangle", file.string(), "Export it with its faces");
  }
  return mesh;
}

}  // namespace raystage::compose
