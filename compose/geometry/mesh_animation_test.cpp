// SPDX-License-Identifier: Apache-2.0
#include "compose/geometry/mesh_animation.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <fstream>
#include <numbers>

#include "base/error.h"
#include "compose/geometry/geometry_layer.h"
#include "testing/test_folder.h"

namespace raystage::compose {
namespace {

using Eigen::Vector3d;
using ::testing::HasSubstr;

/// A triangle (0,0,0) (1,0,0) (0,1,0) below an arm that turns about z from frame 24 to frame 48 of
/// 24 fps.
class TurningTriangle : public ::testing::Test {
 protected:
  /// `moving`: index of the node that turns. `place`: of the arm.
  std::filesystem::path write(const std::string& name,
                              const std::string& scenes = R"("scene":0,"scenes":[{"nodes":[2,0]}])",
                              const std::string& interpolation = "LINEAR",
                              const std::string& more = "", int moving = 0,
                              const std::string& place = "0,0,-5") {
    // positions 0..36, times 36..44, rotations 44..76, more samplers use the same accessors
    std::string bytes;
    const auto put = [&](std::initializer_list<float> values) {
      for (const float value : values) {
        bytes.append(reinterpret_cast<const char*>(&value), sizeof(value));
      }
    };
    put({0, 0, 0, 1, 0, 0, 0, 1, 0});
    put({1, 2});
    const auto half = static_cast<float>(std::numbers::sqrt2 / 2);
    put({0, 0, 0, 1, 0, 0, half, half});
    std::ofstream(folder_.path() / "data.bin", std::ios::binary) << bytes;
    std::ofstream(folder_.path() / name) << R"({"asset":{"version":"2.0"},)" << scenes << R"(,
      "nodes":[{"name":"arm","translation":[)"
                                         << place << R"(],"children":[1]},
               {"name":"leaf","mesh":0,"translation":[2,0,0]}, {"name":"other"}],
      "meshes":[{"primitives":[{"attributes":{"POSITION":0}}]}],
      "animations":[{"channels":[{"sampler":0,"target":{"node":)"
                                         << moving << R"(,"path":"rotation"}})" << more << R"(],
        "samplers":[{"input":1,"output":2,"interpolation":")"
                                         << interpolation << R"("}]}],
      "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
                   {"bufferView":1,"componentType":5126,"count":2,"type":"SCALAR","min":[1],"max":[2]},
                   {"bufferView":2,"componentType":5126,"count":2,"type":"VEC4"}],
      "bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":8},
                     {"buffer":0,"byteOffset":44,"byteLength":32}],
      "buffers":[{"byteLength":76,"uri":"data.bin"}]})";
    return folder_.path() / name;
  }
  /// Returns the position of the triangle's second corner, world.
  Vector3d corner_at(const GeometryLayer& layer, double frame) {
    const MeshInstance instance = layer.instance_at(frame);
    Vector3d found = Vector3d::Zero();
    double most = -1;
    for (const Vector3d& p : instance.scene->mesh().positions) {  // farthest from the arm's axis
      const double out = p.head<2>().norm();
      if (out > most) found = p, most = out;
    }
    return instance.world_from_object * found;
  }
  GeometryLayer open(const std::string& file, bool is_animated = true, FrameRate fps = {24, 1}) {
    schemas::ShotDocument::Geometry geometry;
    geometry.file = file;
    geometry.is_animated = is_animated;
    return {geometry, fps, folder_.path(), "shot.json#/layers/0/geometry", textures_};
  }
  std::string refusal(const std::string& file, FrameRate fps = {24, 1}) {
    try {
      open(file, true, fps);
    } catch (const Error& error) {
      return error.what();
    }
    return "none";
  }

  testing::TestFolder folder_;
  Textures textures_{std::size_t{1} << 20, std::size_t{16} << 20};
};

TEST_F(TurningTriangle, TurnsAtTheFramesOfTheFile) {
  write("turn.gltf");
  const GeometryLayer layer = open("turn.gltf");
  EXPECT_LT((corner_at(layer, 1) - Vector3d(3, 0, -5)).norm(), 1e-6);
  EXPECT_LT((corner_at(layer, 24) - Vector3d(3, 0, -5)).norm(), 1e-6);
  const double eighth = std::numbers::pi / 4;
  EXPECT_LT(
      (corner_at(layer, 36) - Vector3d(3 * std::cos(eighth), 3 * std::sin(eighth), -5)).norm(),
      1e-6);
  EXPECT_LT((corner_at(layer, 48) - Vector3d(0, 3, -5)).norm(), 1e-6);
  EXPECT_LT((corner_at(layer, 1000) - Vector3d(0, 3, -5)).norm(), 1e-6);
  EXPECT_GT(layer.frame_bytes(), 0U);
}

TEST_F(TurningTriangle, StepsWhereTheFileSaysSo) {
  write("step.gltf", R"("scene":0,"scenes":[{"nodes":[0]}])", "STEP");
  const GeometryLayer layer = open("step.gltf");
  EXPECT_LT((corner_at(layer, 47) - Vector3d(3, 0, -5)).norm(), 1e-6);
  EXPECT_LT((corner_at(layer, 48) - Vector3d(0, 3, -5)).norm(), 1e-6);
}

TEST_F(TurningTriangle, StandsStillOnRequest) {
  write("turn.gltf");
  const GeometryLayer layer = open("turn.gltf", false);
  EXPECT_LT((corner_at(layer, 48) - Vector3d(3, 0, -5)).norm(), 1e-6);
  EXPECT_EQ(layer.frame_bytes(), 0U);
}

TEST_F(TurningTriangle, OffsetsDelayIt) {
  write("turn.gltf");
  schemas::ShotDocument::Geometry geometry;
  geometry.file = "turn.gltf";
  geometry.frame_offset = 1000;
  const GeometryLayer layer(geometry, {24, 1}, folder_.path(), "here", textures_);
  EXPECT_LT((corner_at(layer, 1048) - Vector3d(0, 3, -5)).norm(), 1e-6);
  EXPECT_LT((corner_at(layer, 1024) - Vector3d(3, 0, -5)).norm(), 1e-6);
  EXPECT_EQ(layer.key_frames(), (std::array{1024.0, 1048.0}));
}

/// An animated light or camera beside the mesh needs no new mesh for each frame.
TEST_F(TurningTriangle, MotionOfOtherNodesDoesNotCount) {
  write("other.gltf", R"("scene":0,"scenes":[{"nodes":[2,0]}])", "LINEAR", "", 2);
  const GeometryLayer layer = open("other.gltf");
  EXPECT_FALSE(layer.key_frames());
  EXPECT_EQ(layer.frame_bytes(), 0U);
  EXPECT_FALSE(layer.has_unread_animation());
  EXPECT_LT((corner_at(layer, 48) - Vector3d(3, 0, -5)).norm(), 1e-6);
}

TEST_F(TurningTriangle, PlacesOfNodesCountForTheFingerprint) {
  const auto print_of = [&](const std::string& name, const std::string& place) {
    write(name, R"("scene":0,"scenes":[{"nodes":[0]}])", "LINEAR", "", 0, place);
    Fingerprint print;
    open(name, false).add_to_fingerprint(print, 1, {});
    return print.hex();
  };
  EXPECT_NE(print_of("a.gltf", "0,0,-5"), print_of("b.gltf", "0,0,-6"));
  EXPECT_EQ(print_of("a.gltf", "0,0,-5"), print_of("b.gltf", "0,0,-5"));
}

TEST_F(TurningTriangle, FramesThatDifferHaveOtherFingerprints) {
  write("turn.gltf");
  const GeometryLayer layer = open("turn.gltf");
  const auto print_at = [&](int frame) {
    Fingerprint print;
    layer.add_to_fingerprint(print, frame, {});
    return print.hex();
  };
  EXPECT_EQ(print_at(1), print_at(24));
  EXPECT_NE(print_at(30), print_at(31));
}

TEST_F(TurningTriangle, SaysWhatIsWrong) {
  write("turn.gltf");
  EXPECT_THAT(refusal("turn.gltf", {47, 2}), HasSubstr("not at frames of 23.5 fps"));
  write("twice.gltf", R"("scene":0,"scenes":[{"nodes":[0]}])", "LINEAR",
        R"(,{"sampler":0,"target":{"node":0,"path":"rotation"}})");
  EXPECT_THAT(refusal("twice.gltf"), HasSubstr("animated twice"));
  EXPECT_THAT(refusal("twice.gltf"), HasSubstr("or write \"animated\": false"));
  write("list.gltf", R"("scene":0,"scenes":[{"nodes":{"a":1}}])");
  EXPECT_THAT(refusal("list.gltf"), HasSubstr("list.gltf"));
}

TEST_F(TurningTriangle, AMissingTextureNamesTheMesh) {
  std::ofstream(folder_.path() / "m.mtl") << "newmtl wood\nmap_Kd maps/wood.png\n";
  std::ofstream(folder_.path() / "m.obj")
      << "mtllib m.mtl\nv 0 0 0\nv 1 0 0\nv 0 1 0\nusemtl wood\nf 1 2 3\n";
  const std::string text = refusal("m.obj");
  EXPECT_THAT(text, HasSubstr("maps/wood.png"));
  EXPECT_THAT(text, HasSubstr("a texture of the mesh " + (folder_.path() / "m.obj").string()));
}

}  // namespace
}  // namespace raystage::compose
