// SPDX-License-Identifier: Apache-2.0
#include "meshes/scene_encoding.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <concepts>
#include <cstdint>
#include <cstring>
#include <stdexcept>
#include <string>
#include <type_traits>
#include <utility>

#include "sandbox/byte_encoding.h"

namespace raystage::meshes {
namespace {

constexpr std::uint64_t kMagic = 0x31656e6563736d72;  // "rmscene1"
using Flag = std::uint8_t;

using Writer = sandbox::ByteWriter;
using Reader = sandbox::ByteReader;

template <class T, std::size_t kSize>
bool are_finite(const std::vector<std::array<T, kSize>>& values) {
  return std::ranges::all_of(values, [](const auto& value) {
    return std::ranges::all_of(value, [](T number) { return std::isfinite(number); });
  });
}

void require_finite(bool is_finite) {
  if (!is_finite) throw std::runtime_error("it has a vertex that is not finite");
}

/// Nodes that share meshes must not make more of them than memory holds: each is placed by itself.
void require_few_instances(const DecodedScene& scene) {
  constexpr std::size_t kMaxElements = 200'000'000;  // positions and triangles
  std::size_t elements = 0;
  for (const DecodedScene::Node& node : scene.nodes) {
    for (const std::uint32_t index : node.meshes) {
      const DecodedScene::Mesh& mesh = scene.meshes[index];
      elements += mesh.positions.size() + mesh.corners.size() + 1;
      if (elements > kMaxElements) {
        throw std::runtime_error("its nodes make more than 200 million vertices and triangles");
      }
    }
  }
}

void read(Reader& reader, DecodedScene::Node& node, std::size_t index, std::size_t meshes) {
  reader.read_plain(node.name);
  reader.read(node.parent);
  reader.read(node.parent_from_node);
  reader.read_plain(node.meshes);
  Reader::require(index == 0 ? node.parent == DecodedScene::kNone : node.parent < index);
  Reader::require(std::ranges::all_of(node.meshes, [&](auto mesh) { return mesh < meshes; }));
}

void read(Reader& reader, DecodedScene::Mesh& mesh, std::size_t materials) {
  reader.read_plain(mesh.name);
  reader.read(mesh.material);
  mesh.is_deformable = reader.read_flag();
  reader.read_plain(mesh.positions);
  reader.read_plain(mesh.normals);
  reader.read_plain(mesh.uvs);
  reader.read_plain(mesh.corners);
  const std::size_t positions = mesh.positions.size();
  Reader::require(mesh.material < materials);
  Reader::require(mesh.normals.empty() || mesh.normals.size() == positions);
  Reader::require(mesh.uvs.empty() || mesh.uvs.size() == positions);
  for (const auto& triangle : mesh.corners) {
    Reader::require(std::ranges::all_of(triangle, [&](auto corner) { return corner < positions; }));
  }
  require_finite(are_finite(mesh.positions) && are_finite(mesh.uvs));
}

void read(Reader& reader, DecodedScene::Material& material, std::size_t images) {
  reader.read(material.color);
  reader.read(material.metallic);
  reader.read(material.roughness);
  material.is_emissive = reader.read_flag();
  reader.read_plain(material.texture);
  reader.read(material.image);
  Reader::require(material.image == DecodedScene::kNone || material.image < images);
  for (float* number : {&material.color[0], &material.color[1], &material.color[2],
                        &material.metallic, &material.roughness}) {
    if (!std::isfinite(*number)) {
      throw std::runtime_error("it has a material with a number that is not finite");
    }
  }
}

}  // namespace

std::vector<std::byte> encode_scene(const DecodedScene& scene) {
  Writer writer;
  writer.write(kMagic);
  writer.write(Flag{scene.is_animated});
  writer.write(std::uint64_t{scene.images.size()});
  for (const DecodedScene::Image& image : scene.images) {
    writer.write_plain(image.name);
    writer.write_plain(image.bytes);
  }
  writer.write(std::uint64_t{scene.materials.size()});
  for (const DecodedScene::Material& material : scene.materials) {
    writer.write(material.color);
    writer.write(material.metallic);
    writer.write(material.roughness);
    writer.write(Flag{material.is_emissive});
    writer.write_plain(material.texture);
    writer.write(material.image);
  }
  writer.write(std::uint64_t{scene.meshes.size()});
  for (const DecodedScene::Mesh& mesh : scene.meshes) {
    writer.write_plain(mesh.name);
    writer.write(mesh.material);
    writer.write(Flag{mesh.is_deformable});
    writer.write_plain(mesh.positions);
    writer.write_plain(mesh.normals);
    writer.write_plain(mesh.uvs);
    writer.write_plain(mesh.corners);
  }
  writer.write(std::uint64_t{scene.nodes.size()});
  for (const DecodedScene::Node& node : scene.nodes) {
    writer.write_plain(node.name);
    writer.write(node.parent);
    writer.write(node.parent_from_node);
    writer.write_plain(node.meshes);
  }
  return writer.take();
}

DecodedScene decode_scene_bytes(std::span<const std::byte> bytes) {
  // Least sizes of elements, bytes: their counts and numbers.
  constexpr std::size_t kLeastImage = 16, kLeastMaterial = 33, kLeastMesh = 45, kLeastNode = 68;
  Reader reader(bytes);
  std::uint64_t magic = 0;
  reader.read(magic);
  Reader::require(magic == kMagic);
  DecodedScene scene;
  scene.is_animated = reader.read_flag();
  scene.images.resize(reader.read_count(kLeastImage));
  for (DecodedScene::Image& image : scene.images) {
    reader.read_plain(image.name);
    reader.read_plain(image.bytes);
  }
  scene.materials.resize(reader.read_count(kLeastMaterial));
  for (DecodedScene::Material& material : scene.materials) {
    read(reader, material, scene.images.size());
  }
  scene.meshes.resize(reader.read_count(kLeastMesh));
  for (DecodedScene::Mesh& mesh : scene.meshes) read(reader, mesh, scene.materials.size());
  scene.nodes.resize(reader.read_count(kLeastNode));
  for (std::size_t i = 0; i < scene.nodes.size(); ++i) {
    read(reader, scene.nodes[i], i, scene.meshes.size());
  }
  Reader::require(reader.is_at_end() && !scene.nodes.empty());
  require_few_instances(scene);
  return scene;
}

}  // namespace raystage::meshes
