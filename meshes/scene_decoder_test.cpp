// SPDX-License-Identifier: Apache-2.0
// Mesh files that crash or hang Assimp, or lead it elsewhere: an error that names the file.
#include "meshes/scene_decoder.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/stat.h>

#include <chrono>
#include <fstream>
#include <string>

#include "base/error.h"
#include "testing/test_folder.h"

namespace raystage::meshes {
namespace {

using ::testing::HasSubstr;

void write_text(const std::filesystem::path& file, const std::string& text) {
  std::ofstream(file, std::ios::binary) << text;
}

constexpr const char* kTriangle = "v 0 0 0\nv 1 0 0\nv 0 1 0\nf 1 2 3\n";

class SceneDecoder : public ::testing::Test {
 protected:
  std::filesystem::path write(const std::string& name, const std::string& text) const {
    std::filesystem::create_directories((path() / name).parent_path());
    write_text(path() / name, text);
    return path() / name;
  }
  void expect_refused(const std::filesystem::path& file) const {
    const auto start = std::chrono::steady_clock::now();
    try {
      decode_scene(file);
      ADD_FAILURE() << file << " was read";
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput) << error.what();
      EXPECT_EQ(error.where(), file.string());
    }
    EXPECT_LT(std::chrono::steady_clock::now() - start, std::chrono::seconds(30));
  }
  const std::filesystem::path& path() const { return folder_.path(); }

 private:
  raystage::testing::TestFolder folder_;
};

TEST_F(SceneDecoder, ReadsNodesMeshesAndMaterials) {
  write("m.mtl", "newmtl red\nKd 1 0 0\nmap_Kd textures/wood.png\n");
  const DecodedScene scene =
      decode_scene(write("m.obj", std::string("mtllib m.mtl\nusemtl red\n") + kTriangle));
  ASSERT_EQ(scene.meshes.size(), 1U);
  EXPECT_EQ(scene.meshes[0].corners.size(), 1U);
  const DecodedScene::Material& material = scene.materials[scene.meshes[0].material];
  EXPECT_EQ(material.color, (std::array<float, 3>{1, 0, 0}));
  EXPECT_EQ(material.texture, "textures/wood.png");
}

TEST_F(SceneDecoder, AnIndexBeyondTheVerticesIsRefused) {
  expect_refused(write("m.ply",
                       "ply\nformat ascii 1.0\nelement vertex 3\nproperty float x\nproperty float "
                       "y\nproperty float z\nelement face 1\nproperty list uchar int "
                       "vertex_indices\nend_header\n0 0 0\n1 0 0\n0 1 0\n3 0 1 2000000000\n"));
}

TEST_F(SceneDecoder, AVertexThatIsNotFiniteIsRefused) {
  expect_refused(write("m.obj", "v 0 0 nan\nv 1 0 0\nv 0 1 0\nf 1 2 3\n"));
}

TEST_F(SceneDecoder, AChainOfNodesEndsNoProcess) {
  std::string nodes;
  constexpr int kNodes = 60000;
  for (int i = 0; i < kNodes; ++i) {
    nodes += i + 1 < kNodes ? fmt::format(R"({{"children":[{}]}},)", i + 1) : R"({"mesh":0})";
  }
  expect_refused(write("m.gltf", R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],)"
                                 R"("nodes":[)" +
                                     nodes + "]}"));
}

TEST_F(SceneDecoder, DeepJsonEndsNoProcess) {
  expect_refused(
      write("m.gltf", R"({"asset":{"version":"2.0"},"x":)" + std::string(3'000'000, '[')));
}

TEST_F(SceneDecoder, DevicesPipesAndLinksAreNotRead) {
  write("elsewhere/secret.mtl", "newmtl red\nKd 1 0 0\n");
  std::filesystem::create_directory(path() / "scene");
  std::filesystem::create_symlink("../elsewhere", path() / "scene" / "link");
  ASSERT_EQ(::mkfifo((path() / "scene" / "pipe.mtl").c_str(), 0600), 0);
  for (const std::string library :
       {"../elsewhere/secret.mtl", "link/secret.mtl", "pipe.mtl", "/dev/zero"}) {
    const DecodedScene scene =
        decode_scene(write("scene/m.obj", "mtllib " + library + "\nusemtl red\n" + kTriangle));
    for (const DecodedScene::Material& material : scene.materials) {
      EXPECT_NE(material.color, (std::array<float, 3>{1, 0, 0})) << library;
    }
  }
  std::filesystem::remove(path() / "scene" / "pipe.obj");
  ASSERT_EQ(::mkfifo((path() / "scene" / "pipe.obj").c_str(), 0600), 0);
  expect_refused(path() / "scene" / "pipe.obj");
}

}  // namespace
}  // namespace raystage::meshes
