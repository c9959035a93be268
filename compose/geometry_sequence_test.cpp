// SPDX-License-Identifier: Apache-2.0
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <fstream>

#include "compose/layers/cryptomatte.h"
#include "images/exr_reader.h"
#include "testing/compose/sequence_test_data.h"

namespace raystage::compose {
namespace {

using ::testing::HasSubstr;

/// The wall's take and a white square of 1 m in front of the camera.
class GeometrySequence : public testing::SequenceTest {
 protected:
  void SetUp() override {
    SequenceTest::SetUp();
    options_.frames = {101};
    options_.existing = ExistingFiles::kOverwrite;
    std::ofstream(folder_.path() / "square.obj")
        << "o sign\nv -0.5 -0.5 0\nv 0.5 -0.5 0\nv 0.5 0.5 0\nv -0.5 0.5 0\nf 1 2 3 4\n";
    shot_.layers.push_back(square(-2));
    shot_.lights = {{.ambient = {{0.5, 0.5, 0.5}}}};
  }

  static schemas::ShotDocument::Layer square(double z, const std::string& kind = "diffuse") {
    schemas::ShotDocument::Layer layer;
    layer.name = "square";
    schemas::ShotDocument::Geometry geometry{.file = "square.obj"};
    geometry.material = schemas::ShotDocument::Material{.kind = kind, .color = {{1, 1, 1}}};
    geometry.keys = {{.frame = 101, .position = {{0.03, -0.03, z}}}};
    geometry.samples = 4;
    layer.geometry = geometry;
    return layer;
  }
  float value(const char* channel, int x, int y) const {
    const images::ExrChannel channels[] = {{channel}};
    return images::read_exr_channels(file(101), channels, "").values[y * 40 + x];
  }
};

TEST_F(GeometrySequence, StandsInTheLightFieldByDepth) {
  shot_.merge = schemas::ShotDocument::Merge::kDepth;
  run();
  EXPECT_NEAR(value("R", 20, 15), 0.5, 1e-3);
  EXPECT_NEAR(value("Z", 20, 15), 2, 1e-4);
  EXPECT_NEAR(value("P.Z", 20, 15), -2, 1e-4);
  EXPECT_NEAR(value("N.Z", 20, 15), 1, 1e-6);
  EXPECT_NEAR(value("albedo.G", 20, 15), 1, 1e-3);
  EXPECT_EQ(value("coverage.V", 20, 15), 0);
  EXPECT_NEAR(value("R", 1, 1), grey(0), 0.005);
  EXPECT_NEAR(value("coverage.V", 1, 1), 1, 1e-3);
  EXPECT_EQ(value("N.Z", 1, 1), 0);
  // The focal plane is 3 m in front of the array.
  shot_.layers[1] = square(-3.5);
  run();
  EXPECT_NEAR(value("R", 20, 15), grey(0), 0.005);
  shot_.layers[1] = square(-2);
  std::swap(shot_.layers[0], shot_.layers[1]);
  shot_.merge = schemas::ShotDocument::Merge::kLayerOrder;
  run();
  EXPECT_NEAR(value("R", 20, 15), grey(0), 0.005) << "the rearmost is stated first";
}

TEST_F(GeometrySequence, ThrowsShadowsOnALightFieldThatReceivesThem) {
  // Light from behind the camera; the focal plane of the wall is 1 m behind the square.
  shot_.merge = schemas::ShotDocument::Merge::kDepth;
  shot_.lights = {{.direction = {{0.5, 0, -1}}, .color = {1, 1, 1}}};
  run();
  const auto row = [&] {
    std::vector<float> values;
    for (int x = 0; x < 40; ++x) values.push_back(value("R", x, 15));
    return values;
  };
  const std::vector<float> without = row();
  shot_.layers[0].shadows = schemas::ShotDocument::ReceivedShadows{.strength = 0.75, .rays = 0};
  run();
  const std::vector<float> with = row();
  int shadowed = 0, at_edge = 0;
  for (std::size_t x = 0; x < 40; ++x) {
    const bool is_wall = std::abs(without[x] - grey(0)) < 0.005F;  // alone
    if (with[x] == without[x] || !is_wall) continue;
    EXPECT_GT(x, 20U) << "the light goes to the right";
    EXPECT_GT(with[x], 0.25F * grey(0) - 0.005F) << x;
    EXPECT_LT(with[x], grey(0)) << x;
    const bool is_whole = std::abs(with[x] - 0.25F * grey(0)) < 0.005F;
    ++(is_whole ? shadowed : at_edge);
  }
  EXPECT_GT(shadowed, 2);
  EXPECT_LE(at_edge, 2) << "the shadow's ends";
  EXPECT_EQ(with[1], without[1]);
  options_.existing = ExistingFiles::kSkip;
  shot_.layers[0].shadows->strength = 0.5;
  EXPECT_EQ(run().rendered, 1);
}

TEST_F(GeometrySequence, ALightIsAskedForRaysAndSoNeedsAMethodThatHasThem) {
  shot_.layers[0].name = "wall";
  shot_.layers[1] = square(-2, "mirror");
  shot_.lights = {{.light_field = "wall"}};
  shot_.layers[0].method = "auto";
  EXPECT_THAT(refusal(), HasSubstr("not for single rays"));
  shot_.layers[0].method = "focal_plane";
  options_.target = {{"target_time", 1.0}};
  EXPECT_EQ(run().rendered, 1) << "a target is one of views";
}

TEST_F(GeometrySequence, CountsTimeWhereItIsSpent) {
  shot_.layers[0].name = "wall";
  shot_.layers[0].opacity = 0;
  shot_.layers[1] = square(-2, "mirror");
  const auto milliseconds = [&] {
    const SequenceReport report = run();
    EXPECT_EQ(report.rendered, 1);
    return report.milliseconds;
  };
  EXPECT_EQ(milliseconds().light_fields, 0);
  shot_.lights = {{.light_field = "wall"}};
  const StageTimes as_light = milliseconds();
  EXPECT_GT(as_light.light_fields, 0);
  EXPECT_GT(as_light.geometry, 0);
}

TEST_F(GeometrySequence, BehindASolidItIsStillInMirrorsBeforeIt) {
  schemas::ShotDocument::Layer solid;
  solid.solid = schemas::ShotDocument::Solid{{0, 0, 0}, 1, {}};
  schemas::ShotDocument::Layer mirror = square(-2, "mirror"), seen = square(2);
  seen.geometry->keys[0].scale = 9;  // behind the camera
  seen.geometry->material->color = {{0.6, 0.6, 0.6}};
  shot_.layers = {seen, solid, mirror};
  shot_.lights = {{.ambient = {{1, 1, 1}}}};
  run();
  EXPECT_NEAR(value("R", 20, 15), 0.6, 1e-3);
  // Out of view it is not rendered, but it still appears in the mirror.
  shot_.layers = {solid, seen, mirror};
  run();
  EXPECT_NEAR(value("R", 20, 15), 0.6, 1e-3);
  shot_.layers = {solid, seen};
  run();
  EXPECT_EQ(value("R", 20, 15), 0);
  EXPECT_EQ(value("N.Z", 20, 15), 0) << "the channel is there";
}

TEST_F(GeometrySequence, HasTheSameChannelsInFramesThatDoNotShowIt) {
  shot_.layers[1].first_frame = 103;
  run();
  EXPECT_EQ(value("N.Z", 20, 15), 0);
  EXPECT_NEAR(value("R", 20, 15), grey(0), 0.005);
}

TEST_F(GeometrySequence, NamesItsObjectsInACryptomatte) {
  shot_.merge = schemas::ShotDocument::Merge::kDepth;
  shot_.layers[0].name = "wall";
  shot_.output.cryptomatte = true;
  for (const char* layout : {"standard", "single"}) {
    shot_.output.layout = layout;
    run();
    const Imf::MultiPartInputFile exr(file(101).c_str());
    const auto& manifest = exr.header(0).typedAttribute<Imf::StringAttribute>(
        "cryptomatte/" + cryptomatte_key() + "/manifest");
    EXPECT_THAT(manifest.value(), HasSubstr("square/sign"));
    EXPECT_EQ(value("CryptoObject00.R", 20, 15), object_id("square/sign"));
    EXPECT_NEAR(value("CryptoObject00.G", 20, 15), 1, 1e-5);
    EXPECT_EQ(value("CryptoObject00.R", 1, 1), object_id("wall"));
    // At the square's edge half of the samples hit it.
    int shared = 0;
    for (int x = 0; x < 40; ++x) {
      const float first = value("CryptoObject00.G", x, 15),
                  second = value("CryptoObject00.A", x, 15);
      EXPECT_NEAR(first + second, 1, 1e-2) << x;
      if (second == 0) continue;
      ++shared;
      EXPECT_NEAR(first, 0.5, 1e-2);
      EXPECT_NE(value("CryptoObject00.R", x, 15), value("CryptoObject00.B", x, 15));
    }
    EXPECT_EQ(shared, 2);
  }
}

TEST_F(GeometrySequence, AMirrorShowsTheLightField) {
  // The square is a mirror through which the camera looks back.
  shot_.layers[0].name = "wall";
  shot_.layers[0].opacity = 0;  // a light only
  shot_.layers[1] = square(-2, "mirror");
  // Rotated by 135 degrees about x, it reflects rays downwards to the wall.
  shot_.layers[1].geometry->keys[0].orientation = {{0.7934, -0.6088, 0, 0}};
  shot_.lights = {{.ambient = {{0.01, 0.02, 0.03}}}, {.light_field = "wall"}};
  run();
  EXPECT_NEAR(value("R", 20, 15), grey(0), 0.01);
  EXPECT_EQ(value("R", 1, 1), 0);
  // At 45 degrees the rays go upwards, where no camera looked.
  shot_.layers[1].geometry->keys[0].orientation = {{0.9239, -0.3827, 0, 0}};
  run();
  EXPECT_NEAR(value("R", 20, 15), 0.01, 1e-3);
  EXPECT_NEAR(value("B", 20, 15), 0.03, 1e-3);
}

TEST_F(GeometrySequence, KnowsWhatMakesAFileOutOfDate) {
  run();
  options_.existing = ExistingFiles::kSkip;
  EXPECT_EQ(run().skipped, 1);
  const auto expect_new = [&](const char* what) {
    EXPECT_EQ(run().rendered, 1) << what;
    EXPECT_EQ(run().skipped, 1) << what;
  };
  shot_.lights[0].ambient = {{0.5, 0.5, 0.6}};
  expect_new("a light");
  shot_.layers[1].geometry->keys[0].scale = 1.5;
  expect_new("a key");
  shot_.layers[1].geometry->material->color = {{1, 1, 0.5}};
  expect_new("a material");
  shot_.layers[1].geometry->samples = 9;
  expect_new("samples");
  std::ofstream(folder_.path() / "square.obj", std::ios::app) << "v 2 2 2\nf 1 2 5\n";
  expect_new("the mesh");
  std::filesystem::rename(folder_.path() / "square.obj", folder_.path() / "moved.obj");
  shot_.layers[1].geometry->file = "moved.obj";
  EXPECT_EQ(run().skipped, 1) << "not where the file lies";
}

TEST_F(GeometrySequence, SaysWhatIsWrongBeforeAnythingIsRendered) {
  shot_.layers[1].geometry->file = "none.obj";
  EXPECT_THAT(refusal(), HasSubstr("the mesh file does not exist"));
  shot_.layers[1].first_frame = 102;  // not requested
  EXPECT_EQ(run().rendered, 1);
  shot_.layers[1] = square(-2);
  shot_.layers[1].geometry->material->texture = "none.png";
  EXPECT_THAT(refusal(), HasSubstr("the texture file does not exist"));
  EXPECT_THAT(refusal(), HasSubstr("relative to the shot's folder"));
  shot_.layers[1] = square(-2);
  shot_.lights = {{.light_field = "nobody"}};
  EXPECT_THAT(refusal(), HasSubstr("shot.json#/lights/0: the light uses the layer \"nobody\""));
  shot_.lights = {{.light_field = "square"}};
  EXPECT_THAT(refusal(), HasSubstr("has no take"));
  shot_.lights = {{.environment = "none.exr"}};
  EXPECT_THAT(refusal(), HasSubstr("the texture file does not exist"));
  shot_.lights.clear();
  shot_.layers[1].geometry->keys[0].orientation = {{0, 0, 0, 0}};
  EXPECT_THAT(refusal(), HasSubstr("shot.json#/layers/1/geometry/keys/0"));
}

TEST_F(GeometrySequence, SaysThatEmissionIsNotRendered) {
  std::ofstream(folder_.path() / "glow.mtl") << "newmtl lamp\nKd 0 0 0\nKe 1 1 1\n";
  std::ofstream(folder_.path() / "glow.obj") << "mtllib glow.mtl\no sign\nv -0.5 -0.5 0\nv 0.5 "
                                                "-0.5 0\nv 0.5 0.5 0\nusemtl lamp\nf 1 2 3\n";
  const auto warns = [&] {
    messages_.clear();
    EXPECT_EQ(run().rendered, 1);
    return std::ranges::any_of(messages_, [](const std::string& message) {
      return message.find("a material of glow.obj emits light") != std::string::npos;
    });
  };
  shot_.layers[1].geometry->file = "glow.obj";
  EXPECT_FALSE(warns()) << "the shot replaces the material";
  shot_.layers[1].geometry->material.reset();
  EXPECT_TRUE(warns());
}

TEST_F(GeometrySequence, SaysWhichAnimationIsNotShown) {
  // A triangle whose node moves from frame 10 to 20 of 10 fps; `path`: what is animated.
  const auto write = [&](const std::string& name, const std::string& path) {
    const std::array<float, 17> values{0, 0, 0, 1, 0, 0, 0, 1, 0, 1, 2, 0, 0, 0, 1, 0, 0};
    std::ofstream(folder_.path() / "data.bin", std::ios::binary)
        .write(reinterpret_cast<const char*>(values.data()), sizeof(values));
    std::ofstream(folder_.path() / name)
        << R"({"asset":{"version":"2.0"},"scene":0,"scenes":[{"nodes":[0]}],"nodes":[{"mesh":0}],
  "meshes":[{"primitives":[{"attributes":{"POSITION":0})"
        << (path == "weights" ? R"(,"targets":[{"POSITION":0}]}],"weights":[0])" : "}]") << R"(}],
  "animations":[{"channels":[{"sampler":0,"target":{"node":0,"path":")"
        << path << R"("}}],"samplers":[{"input":1,"output":)" << (path == "weights" ? 3 : 2)
        << R"(}]}],
  "accessors":[{"bufferView":0,"componentType":5126,"count":3,"type":"VEC3","min":[0,0,0],"max":[1,1,0]},
               {"bufferView":1,"componentType":5126,"count":2,"type":"SCALAR","min":[1],"max":[2]},
               {"bufferView":2,"componentType":5126,"count":2,"type":"VEC3"},
               {"bufferView":1,"componentType":5126,"count":2,"type":"SCALAR"}],
  "bufferViews":[{"buffer":0,"byteLength":36},{"buffer":0,"byteOffset":36,"byteLength":8},
                 {"buffer":0,"byteOffset":44,"byteLength":24}],
  "buffers":[{"byteLength":68,"uri":"data.bin"}]})";
    shot_.layers[1].geometry->file = name;
    messages_.clear();
    EXPECT_EQ(run().rendered, 1);
  };
  const auto reported = [&](const char* text) {
    return std::ranges::any_of(messages_, [&](const std::string& message) {
      return message.find(text) != std::string::npos;
    });
  };
  write("moves.gltf", "translation");
  EXPECT_TRUE(
      reported("layer 1 (square): moves.gltf moves from frame 10 to 20, the shot is 101 to"));
  EXPECT_FALSE(reported("is not read"));
  shot_.layers[1].geometry->frame_offset = 85;  // frames 95 to 105
  write("moves.gltf", "translation");
  EXPECT_FALSE(reported("moves from frame"));
  write("bends.gltf", "weights");
  EXPECT_TRUE(reported("layer 1 (square): the animation of bends.gltf is not read"));
  shot_.layers[1].geometry->is_animated = false;
  write("bends.gltf", "weights");
  EXPECT_FALSE(reported("is not read"));
}

TEST_F(GeometrySequence, IsCountedInMemory) {
  options_.memory_bytes = std::size_t{200} << 20;  // less than the textures' budget
  EXPECT_EQ(run().rendered, 1);
  std::ofstream(folder_.path() / "red.ppm") << "P3 1 1 255 255 0 0";
  shot_.layers[1].geometry->material->texture = "red.ppm";
  EXPECT_THAT(refusal(), HasSubstr("of memory"));
  options_.memory_bytes = std::size_t{600} << 20;
  EXPECT_EQ(run().rendered, 1);
}

}  // namespace
}  // namespace raystage::compose
