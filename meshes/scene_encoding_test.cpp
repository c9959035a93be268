// SPDX-License-Identifier: Apache-2.0
#include "meshes/scene_encoding.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <stdexcept>

namespace raystage::meshes {
namespace {

DecodedScene small_scene() {
  DecodedScene scene;
  scene.is_animated = true;
  scene.images.push_back({"wood", "\x89PNG..."});
  scene.materials.push_back({{0.1F, 0.2F, 0.3F}, 1, 0.5F, true, "a.png", 0});
  scene.materials.emplace_back();
  DecodedScene::Mesh mesh;
  mesh.name = "triangle";
  mesh.material = 1;
  mesh.is_deformable = true;
  mesh.positions = {{0, 0, 0}, {1, 0, 0}, {0, 1, 0}};
  mesh.normals = {{0, 0, 1}, {0, 0, 1}, {0, 0, 1}};
  mesh.uvs = {{0, 0}, {1, 0}, {0, 1}};
  mesh.corners = {{0, 1, 2}};
  scene.meshes.push_back(mesh);
  scene.nodes.push_back({"root", DecodedScene::kNone, {1, 0, 0, 5, 0, 1, 0, 6, 0, 0, 1, 7}, {}});
  scene.nodes.push_back({"leaf", 0, {2, 0, 0, 0, 0, 2, 0, 0, 0, 0, 2, 0}, {0, 0}});
  return scene;
}

void expect_refused(const DecodedScene& scene) {
  EXPECT_THROW(decode_scene_bytes(encode_scene(scene)), std::runtime_error);
}

TEST(SceneEncoding, ReturnsWhatItWasGiven) {
  const DecodedScene scene = small_scene();
  const auto bytes = encode_scene(scene);
  const DecodedScene read = decode_scene_bytes(bytes);
  EXPECT_EQ(encode_scene(read), bytes);
  EXPECT_TRUE(read.is_animated);
  EXPECT_EQ(read.images[0].bytes, scene.images[0].bytes);
  EXPECT_EQ(read.materials[0].color, scene.materials[0].color);
  EXPECT_EQ(read.materials[0].texture, "a.png");
  EXPECT_EQ(read.meshes[0].positions, scene.meshes[0].positions);
  EXPECT_EQ(read.meshes[0].corners, scene.meshes[0].corners);
  EXPECT_EQ(read.nodes[1].parent, 0U);
  EXPECT_EQ(read.nodes[1].meshes, (std::vector<std::uint32_t>{0, 0}));
  EXPECT_EQ(read.nodes[0].parent_from_node, scene.nodes[0].parent_from_node);
}

TEST(SceneEncoding, RefusesBrokenPromises) {
  DecodedScene scene = small_scene();
  scene.meshes[0].corners[0][1] = 3;
  expect_refused(scene);
  scene = small_scene();
  scene.meshes[0].positions[1][2] = std::numeric_limits<float>::infinity();
  expect_refused(scene);
  scene = small_scene();
  scene.meshes[0].uvs[1][0] = std::nanf("");
  expect_refused(scene);
  scene = small_scene();
  scene.materials[0].color[1] = std::nanf("");
  expect_refused(scene);
  scene = small_scene();
  scene.materials[0].roughness = std::numeric_limits<float>::infinity();
  expect_refused(scene);
  scene = small_scene();
  scene.nodes[1].meshes.assign(60'000'000, 0);  // each places three vertices and a triangle
  expect_refused(scene);
  scene = small_scene();
  scene.meshes[0].normals.pop_back();
  expect_refused(scene);
  scene = small_scene();
  scene.meshes[0].material = 2;
  expect_refused(scene);
  scene = small_scene();
  scene.materials[0].image = 1;
  expect_refused(scene);
  scene = small_scene();
  scene.nodes[1].parent = 1;  // itself
  expect_refused(scene);
  scene = small_scene();
  scene.nodes[1].meshes[0] = 1;
  expect_refused(scene);
  scene = small_scene();
  scene.nodes.clear();
  expect_refused(scene);
}

TEST(SceneEncoding, DamagedBytesAreRefusedOrAnotherScene) {
  const auto bytes = encode_scene(small_scene());
  for (std::size_t size = 0; size < bytes.size(); ++size) {
    EXPECT_THROW(decode_scene_bytes(std::span(bytes).first(size)), std::runtime_error) << size;
  }
  for (std::size_t i = 0; i < bytes.size(); ++i) {
    for (const int value : {0, 1, 0x7F, 0xFF}) {
      auto damaged = bytes;
      damaged[i] = std::byte(value);
      try {
        const DecodedScene scene = decode_scene_bytes(damaged);
        EXPECT_FALSE(scene.nodes.empty());
      } catch (const std::runtime_error&) {
        // as good
      }
    }
  }
}

}  // namespace
}  // namespace raystage::meshes
