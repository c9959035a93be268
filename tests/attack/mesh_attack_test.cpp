// SPDX-License-Identifier: Apache-2.0
#include <fmt/format.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <chrono>
#include <cmath>
#include <fstream>
#include <map>
#include <random>
#include <string>
#include <vector>

#include "base/error.h"
#include "meshes/scene_decoder.h"
#include "testing/test_folder.h"
#include "testing/textured_fbx.h"
#include "tests/attack/mutation.h"

namespace raystage::testing {
namespace {

/// Files by name; the first is the mesh.
struct Seed {
  std::string mesh;
  std::map<std::string, std::string> files;
};

std::string obj(int quads) {
  std::string text = "mtllib m.mtl\n";
  for (int i = 0; i <= quads; ++i) {
    text += fmt::format("v {} 0 {}\nv {} 1 {}\nvn 0 0 1\nvt {} 0\n", i, i * 0.1, i, i * 0.1, i);
  }
  text += "usemtl red\ng first\n";
  for (int i = 0; i < quads; ++i) {
    text +=
        fmt::format("f {}/1/1 {}/1/1 {}/1/1 {}/1/1\n", 2 * i + 1, 2 * i + 2, 2 * i + 4, 2 * i + 3);
  }
  return text;
}

std::vector<Seed> seeds() {
  const std::string mtl =
      "newmtl red\nKa 0 0 0\nKd 1 0 0\nKs 0.5 0.5 0.5\nNs 10\nd 1\nillum 2\nmap_Kd -s 1 1 1 a.png\n"
      "map_bump -bm 0.5 b.png\nnewmtl blue\nKd 0 0 1\n";
  const std::string ply =
      "ply\nformat ascii 1.0\ncomment a\nelement vertex 4\nproperty float x\nproperty float y\n"
      "property float z\nproperty uchar red\nelement face 2\nproperty list uchar int "
      "vertex_indices\nend_header\n0 0 0 1\n1 0 0 2\n1 1 0 3\n0 1 0 4\n3 0 1 2\n3 0 2 3\n";
  const std::string gltf =
      R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"name":"n",)"
      R"("children":[1],"translation":[1,2,3]},{"mesh":0,"rotation":[0,0,0,1]}],"meshes":[{)"
      R"("primitives":[{"attributes":{"POSITION":0},"indices":1,"material":0}]}],"materials":[{)"
      R"("pbrMetallicRoughness":{"baseColorFactor":[1,0,0,1]}}],"accessors":[{"bufferView":0,)"
      R"("componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},{)"
      R"("bufferView":1,"componentType":5123,"count":3,"type":"SCALAR"}],"bufferViews":[{)"
      R"("buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":6}],"buffers":[{)"
      R"("byteLength":42,"uri":"a.bin"}]})";
  const std::string bin(42, '\0');
  const std::string stl =
      "solid a\nfacet normal 0 0 1\nouter loop\nvertex 0 0 0\nvertex 1 0 0\nvertex 0 1 0\n"
      "endloop\nendfacet\nendsolid a\n";
  return {{"m.obj", {{"m.obj", obj(8)}, {"m.mtl", mtl}}},
          {"m.ply", {{"m.ply", ply}}},
          {"m.gltf", {{"m.gltf", gltf}, {"a.bin", bin}}},
          {"m.stl", {{"m.stl", stl}}},
          {"m.fbx", {{"m.fbx", textured_fbx("a.png")}}}};
}

class MeshAttack : public ::testing::TestWithParam<std::size_t> {};

TEST_P(MeshAttack, EveryCaseEndsInASceneOrAnErrorOfOurs) {
  const TestFolder folder;
  const Seed seed = seeds()[GetParam()];
  std::mt19937 random(7);  // NOLINT: the same in every run
  int refused = 0;
  for (int i = 0; i < attack_case_count(); ++i) {
    SCOPED_TRACE(i);
    const std::size_t victim = random() % seed.files.size();
    std::size_t index = 0;
    for (const auto& [name, text] : seed.files) {
      std::ofstream(folder.path() / name, std::ios::binary)
          << (i > 0 && index++ == victim ? mutated_text(text, random) : text);
    }
    const auto start = std::chrono::steady_clock::now();
    try {
      const meshes::DecodedScene scene = meshes::decode_scene(folder.path() / seed.mesh);
      for (const meshes::DecodedScene::Mesh& mesh : scene.meshes) {
        for (const auto& corners : mesh.corners) {
          ASSERT_LT(std::ranges::max(corners), mesh.positions.size());
        }
        for (const auto& position : mesh.positions) {
          ASSERT_TRUE(std::ranges::all_of(position, [](float v) { return std::isfinite(v); }));
        }
      }
    } catch (const Error& error) {
      ++refused;
      ASSERT_GT(i, 0) << error.what();  // the seed itself
      ASSERT_EQ(error.exit_code(), ExitCode::kBadInput) << error.what();
    }
    ASSERT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(25));
  }
  RecordProperty("refused", refused);
  EXPECT_LT(refused, attack_case_count());
}

INSTANTIATE_TEST_SUITE_P(Formats, MeshAttack, ::testing::Range(std::size_t{0}, seeds().size()));

}  // namespace
}  // namespace raystage::testing
