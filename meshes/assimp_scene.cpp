// SPDX-License-Identifier: Apache-2.0
#include "meshes/assimp_scene.h"

#include <assimp/MemoryIOWrapper.h>
#include <assimp/material.h>
#include <assimp/postprocess.h>
#include <assimp/scene.h>

#include <algorithm>
#include <assimp/IOSystem.hpp>
#include <assimp/Importer.hpp>
#include <cstddef>
#include <cstdint>
#include <exception>
#include <map>
#include <memory>
#include <stdexcept>
#include <string_view>
#include <utility>
#include <vector>

#include "sandbox/decoder_main.h"

namespace raystage::meshes {
namespace {

/// Files as the parent process opens them.
class RequestedFiles final : public Assimp::IOSystem {
 public:
  bool Exists(const char* file) const override { return sandbox::request_file(file).has_value(); }
  char getOsSeparator() const override { return '/'; }
  Assimp::IOStream* Open(const char* file, const char* mode) override {
    if (std::string_view(mode).find_first_of("wa+") != std::string_view::npos) return nullptr;
    const auto bytes = sandbox::request_file(file);
    if (!bytes) return nullptr;
    auto copy = std::make_unique<std::uint8_t[]>(std::max<std::size_t>(bytes->size(), 1));
    std::ranges::transform(*bytes, copy.get(),
                           [](std::byte value) { return std::to_integer<std::uint8_t>(value); });
    constexpr bool kOwns = true;
    return new Assimp::MemoryIOStream(copy.release(), bytes->size(), kOwns);  // NOLINT: its API
  }
  void Close(Assimp::IOStream* stream) override { delete stream; }  // NOLINT: its API
};

DecodedScene::Material material_from(const aiScene& scene, const aiMaterial& from) {
  DecodedScene::Material material;
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
      material.texture = texture.C_Str();
    } else {
      material.image = static_cast<std::uint32_t>(index);
    }
  }
  from.Get(AI_MATKEY_METALLIC_FACTOR, material.metallic);
  from.Get(AI_MATKEY_ROUGHNESS_FACTOR, material.roughness);
  aiColor3D emitted;
  material.is_emissive =
      from.GetTextureCount(aiTextureType_EMISSIVE) > 0 ||
      (from.Get(AI_MATKEY_COLOR_EMISSIVE, emitted) == AI_SUCCESS && !emitted.IsBlack());
  return material;
}

DecodedScene::Image image_from(const aiTexture& from) {
  DecodedScene::Image image;
  image.name = from.mFilename.C_Str();
  // Assimp states the size of a compressed image as its width, without a height.
  if (from.mHeight == 0 && from.pcData != nullptr) {
    image.bytes.assign(reinterpret_cast<const char*>(from.pcData), from.mWidth);
  }
  return image;
}

DecodedScene::Mesh mesh_from(const aiMesh& from) {
  DecodedScene::Mesh mesh;
  mesh.name = from.mName.C_Str();
  mesh.material = from.mMaterialIndex;
  mesh.is_deformable = from.mNumBones > 0 || from.mNumAnimMeshes > 0;
  const auto vectors = [&](const aiVector3D* values) {
    std::vector<std::array<float, 3>> result(from.mNumVertices);
    for (unsigned v = 0; v < from.mNumVertices; ++v) {
      result[v] = {values[v].x, values[v].y, values[v].z};
    }
    return result;
  };
  mesh.positions = vectors(from.mVertices);
  if (from.HasNormals()) mesh.normals = vectors(from.mNormals);
  if (from.HasTextureCoords(0)) {
    for (unsigned v = 0; v < from.mNumVertices; ++v) {
      mesh.uvs.push_back({from.mTextureCoords[0][v].x, from.mTextureCoords[0][v].y});
    }
  }
  for (unsigned f = 0; f < from.mNumFaces; ++f) {
    const aiFace& face = from.mFaces[f];
    if (face.mNumIndices != 3) continue;  // points and lines
    mesh.corners.push_back({face.mIndices[0], face.mIndices[1], face.mIndices[2]});
  }
  return mesh;
}

/// Adds a node and its descendants, depth first, without recursion: chains may be long.
void add_nodes(const aiNode& root, DecodedScene& scene) {
  std::vector<std::pair<const aiNode*, std::uint32_t>> open{{&root, DecodedScene::kNone}};
  while (!open.empty()) {
    const auto [from, parent] = open.back();
    open.pop_back();
    const auto index = static_cast<std::uint32_t>(scene.nodes.size());
    const aiMatrix4x4& m = from->mTransformation;
    scene.nodes.push_back({from->mName.C_Str(),
                           parent,
                           {m.a1, m.a2, m.a3, m.a4, m.b1, m.b2, m.b3, m.b4, m.c1, m.c2, m.c3, m.c4},
                           {from->mMeshes, from->mMeshes + from->mNumMeshes}});
    for (unsigned i = from->mNumChildren; i > 0; --i) {
      open.emplace_back(from->mChildren[i - 1], index);
    }
  }
}

}  // namespace

DecodedScene read_with_assimp(const std::string& file, bool applies_unit) {
  Assimp::Importer importer;
  importer.SetIOHandler(new RequestedFiles);  // NOLINT: the importer deletes it
  unsigned steps = aiProcess_Triangulate | aiProcess_JoinIdenticalVertices | aiProcess_SortByPType;
  if (applies_unit) steps |= aiProcess_GlobalScale;
  const aiScene* from = importer.ReadFile(file, steps);
  // Assimp keeps exceptions, such as that of too little memory.
  if (from == nullptr && importer.GetException()) std::rethrow_exception(importer.GetException());
  if (from == nullptr) throw std::runtime_error(importer.GetErrorString());
  DecodedScene scene;
  scene.is_animated = from->mNumAnimations > 0;
  for (unsigned i = 0; i < from->mNumTextures; ++i) {
    scene.images.push_back(image_from(*from->mTextures[i]));
  }
  for (unsigned i = 0; i < from->mNumMaterials; ++i) {
    scene.materials.push_back(material_from(*from, *from->mMaterials[i]));
  }
  if (scene.materials.empty()) scene.materials.emplace_back();
  for (unsigned i = 0; i < from->mNumMeshes; ++i) {
    scene.meshes.push_back(mesh_from(*from->mMeshes[i]));
    if (scene.meshes.back().material >= scene.materials.size()) scene.meshes.back().material = 0;
  }
  add_nodes(*from->mRootNode, scene);
  return scene;
}

}  // namespace raystage::meshes
