// SPDX-License-Identifier: Apache-2.0
// AOVs, metadata, working and output colour spaces, focus pulls.
#include <OpenEXR/ImfChannelList.h>
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfStringAttribute.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>
#include <fstream>
#include <set>

#include "compose/exr/exr_file.h"
#include "images/exr_reader.h"
#include "schemas/rig_document.h"
#include "testing/compose/sequence_test_data.h"

namespace raystage::compose {
namespace {

using ::testing::ElementsAre;

/// The wall's light field, with a square mesh in front of its centre from frame 102 on.
class OutputSequence : public testing::SequenceTest {
 protected:
  void SetUp() override {
    SequenceTest::SetUp();
    options_.existing = ExistingFiles::kOverwrite;
    std::ofstream(folder_.path() / "square.obj")
        << "o sign\nv -0.5 -0.5 0\nv 0.5 -0.5 0\nv 0.5 0.5 0\nv -0.5 0.5 0\nf 1 2 3 4\n";
    schemas::ShotDocument::Layer square;
    square.name = "square";
    square.geometry = schemas::ShotDocument::Geometry{
        .file = "square.obj",
        .material = schemas::ShotDocument::Material{.color = {{0.8, 0.2, 0.1}}},
        .keys = {{.frame = 101, .position = {{0.03, -0.03, -2}}}},
        .samples = 4};
    square.first_frame = 102;
    shot_.layers.push_back(square);
    shot_.lights = {{.ambient = {{0.5, 0.9, 0.2}}}};
  }
  std::array<float, 4> pixel(int frame, int x, int y) const {
    const ExrImage image = read_exr(file(frame));
    std::array<float, 4> rgba{};
    std::copy_n(&image.rgba[4 * static_cast<std::size_t>(y * image.width + x)], 4, rgba.begin());
    return rgba;
  }
  std::set<std::string> channels(int frame) const {
    std::set<std::string> names;
    Imf::MultiPartInputFile input(file(frame).c_str());
    for (int part = 0; part < input.parts(); ++part) {
      const auto& list = input.header(part).channels();
      for (auto channel = list.begin(); channel != list.end(); ++channel) {
        names.insert(channel.name());
      }
    }
    return names;
  }
};

TEST_F(OutputSequence, TellsTheAovsThatAreAskedFor) {
  options_.frames = {101, 102};
  shot_.output.aovs = {};
  run();
  for (const int frame : {101, 102}) {
    EXPECT_THAT(channels(frame), ElementsAre("A", "B", "G", "R", "Z"));
  }
  shot_.output.aovs = {"N", "lf.confidence"};
  options_.existing = ExistingFiles::kSkip;
  EXPECT_EQ(run().rendered, 2) << "other channels are another file";
  for (const int frame : {101, 102}) {
    EXPECT_THAT(channels(frame),
                ElementsAre("A", "B", "G", "N.X", "N.Y", "N.Z", "R", "Z", "confidence.V"));
  }
  const images::ExrChannel confidence[] = {{"confidence.V"}};
  const auto values = images::read_exr_channels(file(102), confidence, "").values;
  EXPECT_EQ(values[15 * 40 + 20], 0) << "the mesh";
  EXPECT_GT(values[15 * 40 + 2], 0.9F) << "a wall of one colour";
  options_.aovs = {"lf.nearest"};
  EXPECT_EQ(run().rendered, 2);
  EXPECT_TRUE(channels(101).contains("nearest.V"));
  EXPECT_FALSE(channels(101).contains("cameras.V"));
}

/// Products of light and colour depend on the primaries.
TEST_F(OutputSequence, LightsAndMergesInTheWorkingSpace) {
  options_.frames = {101, 102};
  shot_.output.color.working_space = "lin_ap1_scene";
  shot_.output.color.color_space = "lin_ap1_scene";
  run();
  {
    const Imf::MultiPartInputFile input(file(102).c_str());
    const auto* space = input.header(0).findTypedAttribute<Imf::StringAttribute>("lf:workingSpace");
    ASSERT_NE(space, nullptr);
    EXPECT_EQ(space->value(), "lin_ap1_scene");
  }
  const std::array<float, 4> lit = pixel(102, 20, 15);
  for (std::size_t c = 0; c < 3; ++c) {
    const float product = std::array{0.8F * 0.5F, 0.2F * 0.9F, 0.1F * 0.2F}[c];
    EXPECT_NEAR(lit[c], product, 1e-3F) << "the shot's numbers are of the working space";
  }
  const std::array<float, 4> wall_ap1 = pixel(101, 2, 15);
  for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(wall_ap1[c], grey(0), 0.005F) << "grey stays";

  shot_.output.color.color_space = "lin_rec709_scene";
  run();
  // lin_ap1_scene to Rec.709 (ASWF's ColorInterop, Bradford).
  Eigen::Matrix3f rec709_from_ap1;
  rec709_from_ap1 << 1.70505F, -0.62179F, -0.08326F, -0.13026F, 1.14080F, -0.01055F, -0.02400F,
      -0.12897F, 1.15297F;
  const Eigen::Vector3f expected = rec709_from_ap1 * Eigen::Vector3f(lit[0], lit[1], lit[2]);
  const std::array<float, 4> in_rec709 = pixel(102, 20, 15);
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(in_rec709[c], expected(static_cast<Eigen::Index>(c)), 1e-3F);
  }
  const std::array<float, 4> wall = pixel(101, 2, 15);
  shot_.output.color.working_space = "lin_rec709_scene";
  options_.existing = ExistingFiles::kSkip;
  EXPECT_EQ(run().rendered, 2);
  for (std::size_t c = 0; c < 4; ++c) EXPECT_NEAR(pixel(101, 2, 15)[c], wall[c], 1e-3F);
  EXPECT_GT(std::abs(pixel(102, 20, 15)[0] - in_rec709[0]), 0.01F);
}

/// Without lights or in white light, no colour depends on the working space.
TEST_F(OutputSequence, WhatComesFromElsewhereIsTurnedIntoTheWorkingSpace) {
  // A light field of saturated colour, a texture, a plate of pure red.
  schemas::RigDocument rig = schemas::read_rig(folder_.path() / "take" / "rig.json");
  for (auto& camera : rig.cameras) camera.photometric.contrast = {1, 0.1, 0.3};
  schemas::write_rig(rig, folder_.path() / "take" / "rig.json");
  {
    std::ofstream picture(folder_.path() / "green.ppm", std::ios::binary);
    picture << "P6 8 8 255\n";
    for (int i = 0; i < 64; ++i) picture << static_cast<char>(40) << static_cast<char>(230) << '\5';
  }
  std::ofstream(folder_.path() / "textured.obj")
      << "vt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\nv -2 -2 0\nv 2 -2 0\nv 2 2 0\nv -2 2 0\n"
         "f 1/1 2/2 3/3 4/4\n";
  const schemas::ShotDocument::Layer wall = [&] {
    schemas::ShotDocument::Layer layer = shot_.layers[0];
    layer.name = "wall";
    return layer;
  }();
  const auto mesh = [&](const schemas::ShotDocument::Material& material) {
    schemas::ShotDocument::Layer layer;
    layer.geometry =
        schemas::ShotDocument::Geometry{.file = "textured.obj",
                                        .material = material,
                                        .keys = {{.frame = 101, .position = {{0, 0, -2}}}},
                                        .samples = 1};
    return layer;
  };
  schemas::ShotDocument::Layer red;
  red.solid = schemas::ShotDocument::Solid{{1, 0, 0}, 1, {}};
  options_.frames = {101};
  const std::string output = options_.output;
  options_.output = (folder_.path() / "red.exr").string();
  shot_.layers = {red};
  ASSERT_EQ(run().rendered, 1);
  options_.output = output;
  schemas::ShotDocument::Layer plate;
  plate.plate = schemas::ShotDocument::Plate{.file = "red.exr"};
  schemas::ShotDocument::Layer asked = wall;
  asked.opacity = 0;

  const std::vector<std::vector<schemas::ShotDocument::Layer>> pictures{
      {wall},
      {plate},
      {mesh({.kind = "diffuse", .color = {{1, 1, 1}}, .texture = "green.ppm"})},
      {asked, mesh({.kind = "mirror", .color = {{1, 1, 1}}})}};
  Eigen::Matrix3f ap1_from_rec709;  // ASWF's ColorInterop, Bradford
  ap1_from_rec709 << 0.61310F, 0.33952F, 0.04738F, 0.07019F, 0.91635F, 0.01345F, 0.02062F, 0.10957F,
      0.86981F;
  for (std::size_t i = 0; i < pictures.size(); ++i) {
    shot_.layers = pictures[i];
    shot_.lights = {{.ambient = {{1, 1, 1}}}};
    if (i == 3) {  // a mirror behind the array reflects the scene in front of it
      shot_.lights = {{.light_field = "wall"}};
      shot_.layers[1].geometry->keys[0].position = {{0, 0, 2}};
      shot_.camera.keys.resize(1);
      shot_.camera.keys[0].orientation = {{0, 0, 1, 0}};
    }
    const auto rendered = [&](const char* working, const char* space) {
      shot_.output.color.working_space = working;
      shot_.output.color.color_space = space;
      EXPECT_EQ(run().rendered, 1);
      const std::array<float, 4> rgba = pixel(101, 20, 15);
      return Eigen::Vector3f(rgba[0], rgba[1], rgba[2]);
    };
    const Eigen::Vector3f plain = rendered("lin_rec709_scene", "lin_rec709_scene");
    EXPECT_GT(plain.maxCoeff() - plain.minCoeff(), 0.03F) << i << ": grey shows nothing";
    EXPECT_LT((rendered("lin_ap1_scene", "lin_rec709_scene") - plain).norm(), 2e-3F) << i;
    EXPECT_LT((rendered("lin_ap1_scene", "lin_ap1_scene") - ap1_from_rec709 * plain).norm(), 2e-3F)
        << i;
    EXPECT_LT((rendered("lin_rec709_scene", "lin_ap1_scene") - ap1_from_rec709 * plain).norm(),
              2e-3F)
        << i;
  }
}

TEST_F(OutputSequence, FrameFilesKnowNothingOfOtherFramesMeshes) {
  shot_.output.cryptomatte = true;
  options_.frames = {101};
  run();
  options_.frames = {101, 102};
  options_.existing = ExistingFiles::kSkip;
  const SequenceReport report = run();
  EXPECT_EQ(report.skipped, 1) << "of the whole shot a mesh is opened";
  EXPECT_EQ(report.rendered, 1);
}

TEST_F(OutputSequence, FramesBelowTheLeastCoverageAreReportedAgainWhenKept) {
  shot_.layers.resize(1);
  shot_.camera.keys.resize(1);
  shot_.camera.keys[0].position = {{0.03, -0.03, 0.1}};  // sees past the array's edge
  options_.frames = {101, 102};
  for (const auto fill : {schemas::HoleFill::kNone, schemas::HoleFill::kPushPull}) {
    options_.fill = fill;  // filled pixels are not covered either
    options_.existing = ExistingFiles::kOverwrite;
    options_.least_coverage = 0.5;
    SequenceReport report = run();
    const double covered = read_frame_quality(file(101)).covered_share;
    EXPECT_GT(covered, 0.5);
    EXPECT_LT(covered, 0.98);
    EXPECT_EQ(report.exit_code(), ExitCode::kSuccess);
    options_.least_coverage = 0.99;
    report = run();
    EXPECT_EQ(report.exit_code(), ExitCode::kFellShort);
    EXPECT_EQ(report.frames_below_coverage, (std::vector{101, 102}));
    EXPECT_THAT(report.summary(), ::testing::HasSubstr("2 below the least coverage (101-102)"));
    options_.existing = ExistingFiles::kSkip;
    report = run();
    EXPECT_EQ(report.skipped, 2);
    EXPECT_EQ(report.exit_code(), ExitCode::kFellShort);
    options_.least_coverage = 0;
    EXPECT_EQ(run().exit_code(), ExitCode::kSuccess);
  }
}

TEST_F(OutputSequence, SaysBeforehandThatAViewLooksWhereNoCameraLooked) {
  using ::testing::Contains;
  using ::testing::HasSubstr;
  using ::testing::Not;
  shot_.layers.resize(1);
  options_.frames = {101, 102};
  run();
  EXPECT_THAT(messages_, Not(Contains(HasSubstr("where no camera looked"))));
  shot_.camera.keys.resize(1);
  shot_.camera.keys[0].orientation = {{std::sqrt(0.5), 0, std::sqrt(0.5), 0}};  // 90 degrees left
  run();
  EXPECT_THAT(messages_, Contains(HasSubstr("100 % of the rays of frame 101 have no data")));
}

TEST_F(OutputSequence, TellsWhatAViewDoesNotSeeAndAFocusDoesNotDo) {
  using ::testing::Contains;
  using ::testing::HasSubstr;
  using ::testing::Not;
  shot_.layers.resize(1);
  options_.frames = {101, 102};
  run();
  EXPECT_THAT(messages_, Not(Contains(HasSubstr("seen by no camera"))));
  shot_.camera.keys.resize(1);
  shot_.camera.keys[0].position = {{0.15, -0.03, 0}};  // on the array's edge
  run();
  EXPECT_THAT(messages_,
              Contains(HasSubstr("of the view is seen by no camera, in frames 101-102")));

  shot_.layers[0].focal_plane = {.kind = schemas::ShotDocument::FocalPlane::Kind::kKeys,
                                 .keys = {{101, 2}, {105, 4}}};
  shot_.layers[0].method = "plane_sweep";
  run();
  EXPECT_THAT(messages_, Contains(HasSubstr("ignores the focal plane")));
  shot_.layers[0].method = "focal_plane";
  shot_.merge = schemas::ShotDocument::Merge::kDepth;
  shot_.layers.push_back(shot_.layers[0]);
  run();
  EXPECT_THAT(
      messages_,
      Contains(HasSubstr("layer 1: the whole light field has the depth of its focal plane")));
}

TEST_F(OutputSequence, ALayersFocusIsPulledByItsKeys) {
  using Kind = schemas::ShotDocument::FocalPlane::Kind;
  shot_.layers[0].focal_plane = {.kind = Kind::kKeys, .keys = {{101, 2}, {105, 4}}};
  options_.frames = {101, 103, 105, 106};
  EXPECT_EQ(run().rendered, 4);
  const images::ExrChannel z[] = {{"Z"}};
  for (const auto& [frame, depth] : {std::pair{101, 2.0F}, {103, 3.0F}, {105, 4.0F}, {106, 4.0F}}) {
    EXPECT_NEAR(images::read_exr_channels(file(frame), z, "").values[2], depth, 1e-4F) << frame;
  }
  // A frame depends only on its adjacent keys.
  options_.existing = ExistingFiles::kSkip;
  EXPECT_EQ(run().skipped, 4);
  shot_.layers[0].focal_plane.keys[1].depth = 5;
  const SequenceReport report = run();
  EXPECT_EQ(report.skipped, 1);
  EXPECT_EQ(report.rendered, 3);
  shot_.layers[0].focal_plane.keys[0].depth = 3;
  EXPECT_EQ(run().skipped, 2) << "at the last key and after it nothing changes";
}

}  // namespace
}  // namespace raystage::compose
