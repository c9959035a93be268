// SPDX-License-Identifier: Apache-2.0
// Shots with two eyes, and files of every layout.
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "images/exr_reader.h"
#include "testing/compose/sequence_test_data.h"

namespace raystage::compose {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

class StereoSequence : public testing::SequenceTest {
 protected:
  StereoSequence() {
    options_.frames = {103};
    shot_.camera.stereo = schemas::ShotDocument::Stereo{.interaxial_m = 0.02, .convergence_m = 3};
  }
  std::vector<std::string> views() const {
    const Imf::MultiPartInputFile input(file(103).c_str());
    std::vector<std::string> names;
    for (int part = 0; part < input.parts(); ++part) {
      names.push_back(input.header(part).hasView() ? input.header(part).view() : "");
    }
    return names;
  }
};

TEST_F(StereoSequence, BothEyesAreInOneFile) {
  EXPECT_EQ(run().rendered, 1);
  EXPECT_EQ(files(), 1);
  EXPECT_THAT(views(), ElementsAre("left", "right", "left", "right", "left", "right"));
  const Imf::MultiPartInputFile input(file(103).c_str());
  const float apart =
      Imf::worldToCamera(input.header(0))[3][0] - Imf::worldToCamera(input.header(1))[3][0];
  EXPECT_NEAR(apart, 0.02F, 1e-6F);
  // Opposite lens shifts of the same size, towards the other eye.
  EXPECT_NEAR(input.header(0).screenWindowCenter().x, -input.header(1).screenWindowCenter().x,
              1e-7F);
  EXPECT_NE(input.header(0).screenWindowCenter().x, 0);
  EXPECT_NEAR(middle(103).second, 1, 1e-3F);
}

TEST_F(StereoSequence, TheFingerprintKnowsTheEyesAndTheLayout) {
  run();
  options_.existing = ExistingFiles::kSkip;
  EXPECT_EQ(run().skipped, 1);
  shot_.camera.stereo->interaxial_m = 0.021;
  EXPECT_EQ(run().rendered, 1);
  shot_.camera.stereo->convergence_m = 4;
  EXPECT_EQ(run().rendered, 1);
  options_.layout = "single";
  EXPECT_EQ(run().rendered, 1);
  EXPECT_THAT(views(), ElementsAre(""));
  shot_.camera.stereo.reset();
  EXPECT_EQ(run().rendered, 1);
  EXPECT_EQ(run().skipped, 1);
}

TEST_F(StereoSequence, WhatTheTakeLacksIsBlackInBothEyes) {
  options_.frames = {103, 120};
  shot_.last_frame = 120;
  options_.missing = MissingFrames::kBlack;
  options_.aovs = {"lf.cameras", "lf.nearest"};
  options_.layout = "single";
  EXPECT_EQ(run().rendered, 2);
  constexpr images::ExrChannel kChannels[] = {
      {"A"}, {"right.A"}, {"coverage.right.V"}, {"cameras.right.V"}};
  for (const float value : images::read_exr_channels(file(120), kChannels, "").values) {
    ASSERT_EQ(value, 0);
  }
}

TEST_F(StereoSequence, ACameraThatIsNowhereIsRefusedBeforeTheFirstFrame) {
  shot_.camera.dolly_zoom = schemas::ShotDocument::DollyZoom{.target = {0.03, -0.03, -1}};
  shot_.camera.keys.back().position = {{0.03, -0.03, -2}};
  shot_.camera.keys.back().frame = 104;
  options_.frames = {101, 102, 103};
  EXPECT_THAT(refusal(), HasSubstr("at frame 103 the target of dolly_zoom is not in front"));
  EXPECT_EQ(files(), 0);
}

TEST_F(StereoSequence, MemoryCountsBothEyes) {
  options_.memory_bytes = 1000;
  const std::string two = refusal();
  shot_.camera.stereo.reset();
  EXPECT_NE(refusal(), two);
}

}  // namespace
}  // namespace raystage::compose
