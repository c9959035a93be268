// SPDX-License-Identifier: Apache-2.0
// A mesh file is a stranger's: of the textures that it names, only those below its folder are read.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <stdlib.h>  // setenv is POSIX
#include <sys/stat.h>

#include <fstream>
#include <functional>
#include <string>
#include <utility>
#include <vector>

#include "base/base64.h"
#include "base/contained_path.h"
#include "base/error.h"
#include "compose/geometry/geometry_layer.h"
#include "testing/compose/test_meshes.h"
#include "testing/test_folder.h"
#include "testing/textured_fbx.h"

namespace raystage::compose {
namespace {

using ::testing::HasSubstr;

constexpr const char* kGltf = R"({{"asset":{{"version":"2.0"}},"scene":0,"scenes":[{{"nodes":[0]}}],
    "nodes":[{{"mesh":0}}],"images":[{{"uri":"{0}"}}],"textures":[{{"source":0}}],
    "materials":[{{"pbrMetallicRoughness":{{"baseColorTexture":{{"index":0}}}}}}],
    "meshes":[{{"primitives":[{{"attributes":{{"POSITION":0}},"material":0}}]}}],
    "accessors":[{{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3",
                  "min":[0,0,0],"max":[1,1,0]}}],
    "bufferViews":[{{"buffer":0,"byteLength":36}}],"buffers":[{{"byteLength":36,
    "uri":"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA"}}]}})";

/// Writes a mesh with a texture of this name, and returns the name of the mesh file.
struct Format {
  std::string name;
  std::function<std::string(const std::filesystem::path& folder, const std::string& texture)> write;
};

void write_text_file(const std::filesystem::path& file, const std::string& text) {
  std::ofstream(file, std::ios::binary) << text;
}

const std::vector<Format>& formats() {
  static const std::vector<Format> kFormats{
      {"Obj",
       [](const auto& folder, const std::string& texture) {
         write_text_file(folder / "m.mtl", "newmtl wood\nKd 1 1 1\nmap_Kd " + texture + "\n");
         write_text_file(folder / "m.obj",
                         "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nvt 0 0\nusemtl wood\n"
                         "f 1/1 2/1 3/1\n");
         return std::string("m.obj");
       }},
      {"Gltf",
       [](const auto& folder, const std::string& texture) {
         write_text_file(folder / "m.gltf", fmt::format(kGltf, texture));
         return std::string("m.gltf");
       }},
      {"Fbx",
       [](const auto& folder, const std::string& texture) {
         write_text_file(folder / "m.fbx", testing::textured_fbx(texture));
         return std::string("m.fbx");
       }},
  };
  return kFormats;
}

class MeshTextures : public ::testing::TestWithParam<std::size_t> {
 protected:
  void SetUp() override {
    std::filesystem::create_directories(set_ / "maps");
    const std::string png = *decode_base64(testing::kQuarteredPng);
    for (const std::filesystem::path& file :
         {folder_.path() / "secret.png", set_ / "wood.png", set_ / "maps/wood.png"}) {
      write_text_file(file, png);
    }
    std::filesystem::create_symlink("../secret.png", set_ / "link.png");
    std::filesystem::create_symlink("..", set_ / "up");
    ASSERT_EQ(mkfifo((set_ / "pipe.png").c_str(), 0600), 0);
  }
  void TearDown() override { unsetenv(kFollowLinksVariable); }
  /// Returns the error of a layer whose mesh has a texture of this name, or "none".
  std::string refusal(const std::string& texture) {
    return refusal(texture, "set/", folder_.path());
  }
  /// `prefix`: of the mesh's path, relative to `base`.
  std::string refusal(const std::string& texture, const std::string& prefix,
                      const std::filesystem::path& base) {
    schemas::ShotDocument::Geometry geometry;
    geometry.file = prefix + formats()[GetParam()].write(set_, texture);
    Textures textures(1 << 20, 1 << 20);
    try {
      const GeometryLayer layer(geometry, {24, 1}, base, "shot.json#/layers/0", textures);
      EXPECT_TRUE(textures.is_used()) << "the mesh has no texture";
      return "none";
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      return error.what();
    }
  }
  testing::TestFolder folder_;
  const std::filesystem::path set_ = folder_.path() / "set";
};

TEST_P(MeshTextures, BelowTheMeshAreRead) {
  for (const std::string& texture :
       {std::string("wood.png"), std::string("maps/wood.png"), std::string("maps/../wood.png"),
        (set_ / "maps/wood.png").string()}) {
    EXPECT_EQ(refusal(texture), "none") << texture;
  }
}

TEST_P(MeshTextures, NextToAMeshInTheCurrentFolderAreRead) {
  const std::filesystem::path before = std::filesystem::current_path();
  std::filesystem::current_path(set_);
  EXPECT_EQ(refusal("wood.png", "", ""), "none");
  EXPECT_THAT(refusal("../secret.png", "", ""), HasSubstr("leaves its folder"));
  EXPECT_EQ(setenv(kFollowLinksVariable, "1", 1), 0);
  EXPECT_EQ(refusal("wood.png", "", ""), "none");
  std::filesystem::current_path(before);
}

TEST_P(MeshTextures, ElsewhereAreRefused) {
  for (const std::string& texture :
       {std::string("../secret.png"), (folder_.path() / "secret.png").string(),
        std::string("maps/../../secret.png"), std::string("../set/../secret.png")}) {
    EXPECT_THAT(refusal(texture), HasSubstr("leaves its folder")) << texture;
  }
  EXPECT_THAT(refusal("link.png"), HasSubstr("link"));
  EXPECT_THAT(refusal("up/secret.png"), HasSubstr("link"));
  EXPECT_THAT(refusal("none.png"), HasSubstr("the texture file does not exist"));
  EXPECT_THAT(refusal("pipe.png"), HasSubstr("pipe.png")) << "and not a wait";
}

TEST_P(MeshTextures, ElsewhereAreReadWhereLinksArePermitted) {
  ASSERT_EQ(setenv(kFollowLinksVariable, "1", 1), 0);
  for (const std::string& texture :
       {std::string("../secret.png"), (folder_.path() / "secret.png").string(),
        std::string("link.png"), std::string("wood.png")}) {
    EXPECT_EQ(refusal(texture), "none") << texture;
  }
}

/// A shot may name any file: it may replace what the mesh file must not show.
TEST_P(MeshTextures, OfTheShotMayBeAnywhere) {
  schemas::ShotDocument::Geometry geometry;
  geometry.file = "set/" + formats()[GetParam()].write(set_, "../secret.png");
  geometry.material = schemas::ShotDocument::Material{};
  for (const char* texture : {"secret.png", "set/link.png"}) {
    geometry.material->texture = texture;
    Textures textures(1 << 20, 1 << 20);
    EXPECT_NO_THROW(GeometryLayer(geometry, {24, 1}, folder_.path(), "shot.json", textures));
  }
}

INSTANTIATE_TEST_SUITE_P(Formats, MeshTextures, ::testing::Range(std::size_t{0}, std::size_t{3}),
                         [](const auto& parameter) { return formats()[parameter.param].name; });

}  // namespace
}  // namespace raystage::compose
