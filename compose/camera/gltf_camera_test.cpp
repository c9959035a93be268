// SPDX-License-Identifier: Apache-2.0
#include "compose/camera/gltf_camera.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <functional>
#include <nlohmann/json.hpp>
#include <numbers>

#include "base/atomic_file.h"
#include "base/base64.h"
#include "base/error.h"
#include "testing/test_folder.h"

namespace raystage::compose {
namespace {

using Eigen::AngleAxisd;
using Eigen::Matrix3d;
using Eigen::Quaterniond;
using Eigen::Vector3d;
using nlohmann::json;
using ::testing::HasSubstr;

std::string bytes_of(const std::vector<float>& numbers) {
  std::string bytes(numbers.size() * sizeof(float), '\0');
  std::memcpy(bytes.data(), numbers.data(), bytes.size());
  return bytes;
}

std::string data_uri(const std::string& bytes) {
  return "data:application/octet-stream;base64," + encode_base64(std::as_bytes(std::span(bytes)));
}

/// Returns an animation of 2 s: the boom turns left by 90 degrees while the camera at its end rises
/// by 1 m. Buffer: times 0, 2; two quaternions; two translations.
json boom() {
  const float h = std::sqrt(0.5F);
  const std::string bytes = bytes_of({0, 2, 0, 0, 0, 1, 0, h, 0, h, 0, 0, -3, 0, 1, -3});
  const auto view = [](int offset, int length) {
    return json{{"buffer", 0}, {"byteOffset", offset}, {"byteLength", length}};
  };
  const auto accessor = [](int of_view, int count, const char* type) {
    return json{{"bufferView", of_view}, {"componentType", 5126}, {"count", count}, {"type", type}};
  };
  return {{"asset", {{"version", "2.0"}}},
          {"nodes",
           {{{"name", "boom"}, {"children", {1}}, {"translation", {10, 0, 0}}},
            {{"name", "shot"}, {"camera", 0}, {"translation", {0, 0, -3}}}}},
          {"cameras", {{{"type", "perspective"}, {"perspective", {{"yfov", 0.5}}}}}},
          {"buffers", {{{"byteLength", bytes.size()}, {"uri", data_uri(bytes)}}}},
          {"bufferViews", {view(0, 8), view(8, 32), view(40, 24)}},
          {"accessors", {accessor(0, 2, "SCALAR"), accessor(1, 2, "VEC4"), accessor(2, 2, "VEC3")}},
          {"animations",
           {{{"channels",
              {{{"sampler", 0}, {"target", {{"node", 0}, {"path", "rotation"}}}},
               {{"sampler", 1}, {"target", {{"node", 1}, {"path", "translation"}}}}}},
             {"samplers", {{{"input", 0}, {"output", 1}}, {{"input", 0}, {"output", 2}}}}}}}};
}

class GltfCameras : public ::testing::Test {
 protected:
  GltfCamera read(const json& document, const std::string& name = "") {
    write_file_atomically(folder_.path() / "a.gltf", document.dump());
    return read_gltf_camera(folder_.path() / "a.gltf", name);
  }
  std::string refusal(const std::function<void(json&)>& spoil, const std::string& name = "") {
    json document = boom();
    spoil(document);
    try {
      const GltfCamera camera = read(document, name);
      camera.pose(0.5);
      camera.vertical_fov(0.5);
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      return error.what();
    }
    return "none";
  }

  testing::TestFolder folder_;
};

void expect_boom(const GltfCamera& camera) {
  EXPECT_EQ(camera.name, "shot");
  EXPECT_EQ(camera.key_seconds, (std::vector<double>{0, 2}));
  EXPECT_FALSE(camera.timing.is_rate_stated || camera.timing.first_frame || camera.fov_is_animated);
  EXPECT_EQ(camera.vertical_fov(7), 0.5);
  EXPECT_LT((camera.pose(-1).position - Vector3d(10, 0, -3)).norm(), 1e-6);
  const Matrix3d half = AngleAxisd(std::numbers::pi / 4, Vector3d::UnitY()).toRotationMatrix();
  const rig::Pose pose = camera.pose(1);
  EXPECT_LT((pose.world_from_camera_rotation - half).norm(), 1e-6);
  EXPECT_LT((pose.position - (Vector3d(10, 0, 0) + half * Vector3d(0, 0.5, -3))).norm(), 1e-6);
  EXPECT_LT((camera.pose(99).viewing_direction() - -Vector3d::UnitX()).norm(), 1e-6);
}

TEST_F(GltfCameras, MovesWithTheNodesAboveIt) { expect_boom(read(boom())); }

TEST_F(GltfCameras, ReadsBuffersBesideTheFileAndBinaryFiles) {
  json document = boom();
  const std::string uri = document["buffers"][0]["uri"];
  const std::string bytes = *decode_base64(uri.substr(uri.find(',') + 1));
  document["buffers"][0]["uri"] = "my%20buffer.bin";
  write_file_atomically(folder_.path() / "my buffer.bin", bytes);
  expect_boom(read(document));

  document["buffers"][0].erase("uri");
  std::string text = document.dump();
  text.resize((text.size() + 3) / 4 * 4, ' ');
  const auto word = [](std::size_t value) {
    const auto narrow = static_cast<std::uint32_t>(value);
    std::string four(4, '\0');
    std::memcpy(four.data(), &narrow, 4);
    return four;
  };
  const std::string glb = "glTF" + word(2) + word(28 + text.size() + bytes.size()) +
                          word(text.size()) + "JSON" + text + word(bytes.size()) +
                          std::string("BIN\0", 4) + bytes;
  write_file_atomically(folder_.path() / "a.glb", glb);
  expect_boom(read_gltf_camera(folder_.path() / "a.glb", ""));
  for (const std::size_t cut : {std::size_t{3}, std::size_t{11}, std::size_t{30}, glb.size() - 1}) {
    write_file_atomically(folder_.path() / "b.glb", std::string_view(glb).substr(0, cut));
    EXPECT_THROW(read_gltf_camera(folder_.path() / "b.glb", ""), Error) << cut;
  }
}

TEST_F(GltfCameras, BuffersTogetherHaveALimit) {
  json document = boom();
  {
    std::ofstream file(folder_.path() / "large.bin");  // sparse
    file.seekp(static_cast<std::streamoff>(kMaxSceneBytes));
    file.put('x');
  }
  document["buffers"].push_back({{"uri", "large.bin"}, {"byteLength", 1}});
  EXPECT_THROW(read(document), Error);
  std::filesystem::resize_file(folder_.path() / "large.bin", kMaxSceneBytes - 1);
  EXPECT_THROW(read(document), Error);  // together with the first one
}

TEST_F(GltfCameras, StepsAndSplinesAreTheFilesOwn) {
  json document = boom();
  document["animations"][0]["samplers"][1]["interpolation"] = "STEP";
  GltfCamera camera = read(document);
  const Matrix3d half = AngleAxisd(std::numbers::pi / 4, Vector3d::UnitY()).toRotationMatrix();
  EXPECT_LT((camera.pose(1).position - (Vector3d(10, 0, 0) + half * Vector3d(0, 0, -3))).norm(),
            1e-6);

  // y from 0 to 1, tangents 0 at the start and 1 per second at the end: 1/2 - h / 8 halfway.
  const std::string bytes = bytes_of({0, 2, 0, 0, 0, 0,  0, -3, 0, 0, 0,  //
                                      0, 1, 0, 0, 1, -3, 0, 0,  0});
  document = boom();
  document["buffers"].push_back({{"byteLength", bytes.size()}, {"uri", data_uri(bytes)}});
  document["bufferViews"].push_back({{"buffer", 1}, {"byteOffset", 8}, {"byteLength", 72}});
  document["accessors"].push_back(
      {{"bufferView", 3}, {"componentType", 5126}, {"count", 6}, {"type", "VEC3"}});
  document["animations"][0]["samplers"][1] = {
      {"input", 0}, {"output", 3}, {"interpolation", "CUBICSPLINE"}};
  document["animations"][0]["channels"].erase(0);  // the boom does not move
  camera = read(document);
  EXPECT_NEAR(camera.pose(1).position.y(), 0.25, 1e-6);
  EXPECT_NEAR(camera.pose(2).position.y(), 1, 1e-6);
}

TEST_F(GltfCameras, IsFoundByTheNameOfItsNodeOrItsOwn) {
  json document = boom();
  document["cameras"].push_back(
      {{"name", "wide"}, {"type", "perspective"}, {"perspective", {{"yfov", 1.5}}}});
  document["nodes"].push_back({{"camera", 1}});
  EXPECT_EQ(read(document, "wide").vertical_fov(0), 1.5);
  EXPECT_EQ(read(document, "shot").vertical_fov(0), 0.5);
  EXPECT_THROW(read(document), Error);
  try {
    read(document, "other");
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("no camera \"other\", only shot, wide"));
  }
}

TEST_F(GltfCameras, ScaleAboveIsLeftOut) {
  json document = boom();
  document["nodes"][0]["scale"] = {2, 2, 2};
  const rig::Pose pose = read(document).pose(0);
  EXPECT_LT((pose.position - Vector3d(10, 0, -6)).norm(), 1e-6);
  EXPECT_LT((pose.world_from_camera_rotation - Matrix3d::Identity()).norm(), 1e-6);
}

TEST_F(GltfCameras, SaysWhatIsWrongAndWhere) {
  EXPECT_THAT(refusal([](json& d) { d["asset"]["version"] = "1.0"; }), HasSubstr("not glTF 2.0"));
  EXPECT_THAT(refusal([](json& d) { d["cameras"][0]["type"] = "orthographic"; }),
              HasSubstr("#/cameras/0: the camera is not a perspective camera"));
  EXPECT_THAT(refusal([](json& d) { d["nodes"][1].erase("camera"); }),
              HasSubstr("the file has no camera"));
  EXPECT_THAT(refusal([](json& d) {
                d["nodes"][0]["scale"] = {-1, 1, 1};
              }),
              HasSubstr("mirrored or skewed"));
  EXPECT_THAT(refusal([](json& d) { d["nodes"][1]["children"] = {0}; }), HasSubstr("own ancestor"));
  EXPECT_THAT(refusal([](json& d) { d["accessors"][2]["count"] = 3; }),
              HasSubstr("#/accessors/2: the accessor exceeds its buffer"));
  EXPECT_THAT(refusal([](json& d) { d["bufferViews"][2]["byteLength"] = 1 << 30; }),
              HasSubstr("exceeds its buffer"));
  // 2^24 steps of 2^40 bytes are 0 in 64 bits.
  EXPECT_THAT(refusal([](json& d) {
                d["bufferViews"][0]["byteStride"] = std::int64_t{1} << 40;
                d["accessors"][0]["count"] = (1 << 24) + 1;
              }),
              HasSubstr("exceeds its buffer"));
  EXPECT_THAT(refusal([](json& d) { d["accessors"][2]["bufferView"] = 17; }),
              HasSubstr("an index is 17, but there are 3 bufferViews"));
  EXPECT_THAT(refusal([](json& d) { d["accessors"][1]["type"] = "VEC3"; }),
              HasSubstr("does not have 4 numbers"));
  EXPECT_THAT(refusal([](json& d) { d["buffers"][0]["uri"] = "data:;base64,@@"; }),
              HasSubstr("not base64"));
  EXPECT_THAT(refusal([](json& d) { d["buffers"][0]["uri"] = "gone.bin"; }), HasSubstr("gone.bin"));
  for (const char* outside : {"/dev/zero", "../other.bin", "a/../../other.bin"}) {
    EXPECT_THAT(refusal([&](json& d) { d["buffers"][0]["uri"] = outside; }),
                HasSubstr("leaves its folder"));
  }
  EXPECT_THAT(refusal([](json& d) { d["animations"].push_back(d["animations"][0]); }),
              HasSubstr("/nodes/0/rotation is animated twice"));
  EXPECT_THAT(refusal([](json& d) { d["cameras"][0]["perspective"]["yfov"] = 4; }),
              HasSubstr("#/cameras/0/perspective/yfov"));
  const std::string bytes = bytes_of({0, 2, 0, 0, 0, 1, 0, NAN, 0, 1, 0, 0, -3, 0, 1, -3});
  EXPECT_THAT(refusal([&](json& d) { d["buffers"][0]["uri"] = data_uri(bytes); }),
              HasSubstr("#/accessors/1: element 1 is not finite"));
  EXPECT_THAT(refusal([](json& d) { d["animations"][0]["samplers"][0]["input"] = 2; }),
              HasSubstr("does not have 1 numbers"));
  for (const json& rate : {json("24/0"), json(0), json(1e300), json("fast"), json::array()}) {
    EXPECT_THAT(refusal([&](json& d) { d["asset"]["extras"]["fps"] = rate; }),
                HasSubstr("#/asset/extras/fps: found"));
  }
  for (const json& frame : {json("1"), json(1e12), json(1.5), json(1'000'000'000'000)}) {
    EXPECT_THAT(refusal([&](json& d) { d["asset"]["extras"]["first_frame"] = frame; }),
                HasSubstr("#/asset/extras/first_frame: found"));
  }
}

TEST_F(GltfCameras, WhatIsWrittenComesBack) {
  std::vector<GltfCameraKey> keys;
  for (int i = 0; i < 25; ++i) {
    GltfCameraKey key;
    key.seconds = i / 24.0;
    key.pose.position = {0.1 * i, 1.5, -0.02 * i * i};
    key.pose.world_from_camera_rotation =
        AngleAxisd(0.3 * i, Vector3d(0.1, 1, 0).normalized()).toRotationMatrix();
    key.vertical_fov = 0.6 + 0.01 * i;
    keys.push_back(key);
  }
  const GltfCamera camera =
      read(json::parse(format_gltf_camera("crane", 16.0 / 9, keys, {24, 1}, 0)));
  EXPECT_EQ(camera.name, "crane");
  EXPECT_NEAR(camera.key_seconds.back(), 1, 1e-6);
  EXPECT_EQ(camera.timing.frame_rate, (FrameRate{24, 1}));
  EXPECT_EQ(camera.timing.first_frame, 0);
  EXPECT_TRUE(camera.fov_is_animated);
  for (const GltfCameraKey& key : keys) {
    const rig::Pose pose = camera.pose(key.seconds);
    EXPECT_LT((pose.position - key.pose.position).norm(), 1e-5);
    EXPECT_LT((pose.world_from_camera_rotation - key.pose.world_from_camera_rotation).norm(), 2e-6);
    EXPECT_NEAR(camera.vertical_fov(key.seconds), key.vertical_fov, 1e-6);
  }
  // The smaller angle between keys, as readers apply slerp.
  EXPECT_LT(Eigen::AngleAxisd(camera.pose(0.5 / 24).world_from_camera_rotation).angle(), 0.16);
}

/// Channels of unknown targets are skipped, also those whose extensions are no objects.
TEST_F(GltfCameras, ChannelsWithoutATargetAreSkipped) {
  const json expected = boom();
  for (const json& extensions : {json("x"), json::array(), json{{"KHR_animation_pointer", 3}}}) {
    json document = boom();
    document["animations"][0]["channels"].push_back(
        {{"sampler", 0}, {"target", {{"path", "pointer"}, {"extensions", extensions}}}});
    EXPECT_EQ(read(document).key_seconds, read(expected).key_seconds) << extensions;
  }
  EXPECT_THAT(refusal([](json& d) {
                d["animations"][0]["channels"] = {{"a", 1}};
              }),
              HasSubstr("/animations/0/channels: found"));
}

TEST_F(GltfCameras, WhatStandsStillIsNotAnimated) {
  const std::vector<GltfCameraKey> keys(3);
  const json document = json::parse(format_gltf_camera("still", 1.5, keys, {24000, 1001}, 1001));
  EXPECT_FALSE(document.contains("animations"));
  EXPECT_FALSE(document.contains("extensionsUsed"));
  EXPECT_TRUE(read(document).key_seconds.empty());
  EXPECT_EQ(read(document).timing.frame_rate, (FrameRate{24000, 1001}));
}

}  // namespace
}  // namespace raystage::compose
