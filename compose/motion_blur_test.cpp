// SPDX-License-Identifier: Apache-2.0
// Motion blur of the camera, meshes and light fields together. The reference renders many sharp
// frames and averages them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <cmath>
#include <fstream>

#include "base/atomic_file.h"
#include "compose/exposure_plan.h"
#include "images/exr_reader.h"
#include "testing/compose/sequence_test_data.h"

namespace raystage::compose {
namespace {

using ::testing::HasSubstr;
using Layer = schemas::ShotDocument::Layer;

class MotionBlur : public testing::SequenceTest {
 protected:
  void SetUp() override {
    SequenceTest::SetUp();
    std::ofstream(folder_.path() / "square.obj")
        << "o sign\nv -0.5 -0.5 0\nv 0.5 -0.5 0\nv 0.5 0.5 0\nv -0.5 0.5 0\nf 1 2 3 4\n";
    options_.existing = ExistingFiles::kOverwrite;
    shot_.camera.keys[0].shutter_deg = 180;
  }
  /// Adds a white square that moves to the right.
  void add_square() {
    schemas::ShotDocument::Geometry geometry{.file = "square.obj"};
    geometry.material = schemas::ShotDocument::Material{.kind = "diffuse", .color = {{1, 1, 1}}};
    geometry.keys = {{.frame = 101, .position = {{-0.9, 0, -3}}},
                     {.frame = 106, .position = {{1.1, 0, -3}}}};
    geometry.samples = 64;
    Layer layer;
    layer.name = "square";
    layer.geometry = geometry;
    shot_.layers.push_back(layer);
    shot_.lights = {{.ambient = {{0.5, 0.5, 0.5}}}};
  }
  void keep_camera_still() {
    shot_.camera.keys.resize(1);
    shot_.camera.keys[0].position = {{0, 0, 0}};
  }
  ExrImage image(int frame) const { return read_exr(file(frame)); }
  std::vector<float> depths(int frame) const {
    const images::ExrChannel channels[] = {{"Z"}};
    return images::read_exr_channels(file(frame), channels, "").values;
  }
  std::vector<double> offsets(int frame) {
    schemas::write_shot(shot_, shot_file());
    return exposure_offsets(ShotPlan(shot_file()), frame);
  }
};

// The edges of the square sweep over pixels: A is the part of the time that it covers them.
TEST_F(MotionBlur, OfAMeshIsThePartOfTheTimeThatItCoversAPixel) {
  shot_.layers.clear();
  add_square();
  keep_camera_still();
  shot_.output.motion_samples = 257;
  run();
  constexpr int kFrame = 103;
  const ShotPlan plan(shot_file());
  const render::VirtualCamera view = plan.camera(kFrame, Eye::kBoth);
  const auto edge = [&](double x, double frame) {
    return view.intrinsics.cx + view.intrinsics.fx * (x - 0.9 + 2 * (frame - 101) / 5) / 3;
  };
  const ExrImage blurred = image(kFrame);
  int partial = 0;
  for (int x = 0; x < shot_.width; ++x) {
    double covered = 0;
    constexpr int kTimes = 2000;
    for (int t = 0; t < kTimes; ++t) {
      const double time = kFrame - 0.25 + 0.5 * (t + 0.5) / kTimes;
      covered += std::max(0.0, std::min(x + 1.0, edge(0.5, time)) -
                                   std::max<double>(x, edge(-0.5, time))) /
                 kTimes;
    }
    const float alpha = blurred.rgba[4 * (static_cast<std::size_t>(15) * 40 + x) + 3];
    EXPECT_NEAR(alpha, covered, 0.02) << x;
    partial += covered > 0.05 && covered < 0.95 ? 1 : 0;
  }
  EXPECT_GE(partial, 5);
}

// The grey of the wall is linear in time, as a code.
TEST_F(MotionBlur, OfALightFieldIsItsMeanOverTheExposure) {
  keep_camera_still();
  shot_.camera.keys[0].position = {{0.03, -0.03, 0}};
  shot_.layers.front().time = Layer::Time::kExact;
  shot_.camera.keys[0].shutter_deg = 360;
  shot_.layers.front().start_seconds = 0.25;
  shot_.layers.front().speed = 5;
  shot_.last_frame = 101;
  run();
  double mean = 0;
  constexpr int kTimes = 1000;
  for (int t = 0; t < kTimes; ++t) {
    const double ticks = 5 * (t + 0.5) / kTimes;
    mean += linear_from_srgb((testing::kFirstGrey + testing::kStep * ticks) / 255) / kTimes;
  }
  EXPECT_NEAR(middle(101).first, mean, 0.002);
  shot_.output.motion_samples = 1;
  run();
  EXPECT_GT(std::abs(mean - middle(101).first), 0.01) << "the sharp frame differs";
  shot_.output.motion_samples = 33;
  shot_.layers.front().time = Layer::Time::kTick;
  EXPECT_TRUE(offsets(101).empty()) << "the nearest instant is that of the frame";
}

// The same shot at 64 times the frame rate, without blur, is the reference.
TEST_F(MotionBlur, IsTheMeanOfSharpFramesForEverythingTogether) {
  constexpr int kRate = 64, kFrame = 103;
  add_square();
  shot_.layers.front().time = Layer::Time::kExact;
  shot_.merge = schemas::ShotDocument::Merge::kDepth;
  shot_.camera.keys.back().position = {{0.09, -0.06, 0.02}};
  shot_.camera.keys.back().shutter_deg = 180;
  shot_.output.motion_samples = kRate / 2 + 1;
  options_.frames = {kFrame};
  run();
  const ExrImage blurred = image(kFrame);
  const std::vector<float> z_before = depths(kFrame);
  const auto scaled = [&](double frame) { return static_cast<int>((frame - 101) * kRate) + 101; };
  for (auto& key : shot_.camera.keys) key.frame = scaled(key.frame);
  for (auto& key : shot_.layers.back().geometry->keys) key.frame = scaled(key.frame);
  shot_.fps = shot_.fps_numerator = 10 * kRate;
  shot_.last_frame = scaled(shot_.last_frame);
  shot_.output.motion_samples = 1;
  std::vector<double> mean(blurred.rgba.size());
  std::vector<int> frames;
  for (int i = -kRate / 4; i <= kRate / 4; ++i) frames.push_back(scaled(kFrame) + i);
  options_.frames = frames;
  run();
  for (const int frame : frames) {
    const bool is_end = frame == frames.front() || frame == frames.back();
    const ExrImage sharp = image(frame);
    for (std::size_t i = 0; i < mean.size(); ++i) {
      mean[i] += (is_end ? 0.5 : 1) * sharp.rgba[i] / (kRate / 2.0);
    }
  }
  double most = 0;
  const ExrImage sharp = image(scaled(kFrame));
  for (std::size_t i = 0; i < mean.size(); ++i) {
    EXPECT_NEAR(blurred.rgba[i], mean[i], 0.025) << i;
    most = std::max(most, std::abs(sharp.rgba[i] - mean[i]));
  }
  EXPECT_GT(most, 0.1) << "something moves";
  EXPECT_EQ(z_before, depths(scaled(kFrame))) << "of the middle";
}

TEST_F(MotionBlur, TakesAsManyTimesAsThingsMovePixels) {
  add_square();
  keep_camera_still();
  // It moves by 0.2 m, its bounds at 2.3 m: 4.8 pixels; 8 intervals.
  EXPECT_EQ(offsets(103).size(), 9U);
  EXPECT_EQ(offsets(103).front(), -0.25);
  EXPECT_EQ(offsets(103).back(), 0.25);
  shot_.layers.back().geometry->keys[1].position = {{20, 0, -3}};
  EXPECT_EQ(offsets(103).size(), 33U);
  shot_.output.motion_samples = 8;
  EXPECT_EQ(offsets(103).size(), 5U);
  shot_.output.motion_samples = 1;
  EXPECT_TRUE(offsets(103).empty());
  shot_.output.motion_samples = 33;
  shot_.layers.pop_back();
  EXPECT_TRUE(offsets(103).empty()) << "nothing moves";
  shot_.layers.front().time = Layer::Time::kExact;
  EXPECT_EQ(offsets(103).size(), 9U);
  shot_.layers.front().speed = 0;
  EXPECT_TRUE(offsets(103).empty()) << "the light field stands still";
}

TEST_F(MotionBlur, OfNothingThatMovesIsTheSharpFrame) {
  add_square();
  keep_camera_still();
  shot_.layers.back().geometry->keys.resize(1);
  run();
  const std::string with_shutter = read_file(file(103));
  shot_.output.motion_samples = 1;
  run();
  EXPECT_EQ(read_file(file(103)), with_shutter);
}

TEST_F(MotionBlur, CountsForWhatIsOutOfDate) {
  add_square();
  keep_camera_still();
  run();
  options_.existing = ExistingFiles::kSkip;
  EXPECT_EQ(run().rendered, 0);
  shot_.camera.keys[0].shutter_deg = 170;
  EXPECT_EQ(run().rendered, 6);
  shot_.output.motion_samples = 1;
  EXPECT_EQ(run().rendered, 6);
}

// The focus of frame 101 stays, but not that of the time until the shutter closes.
TEST_F(MotionBlur, CountsFocusWithinTheExposure) {
  add_square();
  keep_camera_still();
  using FocalPlane = schemas::ShotDocument::FocalPlane;
  FocalPlane& focus = shot_.layers.front().focal_plane;
  focus.kind = FocalPlane::Kind::kKeys;
  focus.keys = {{101, 3}, {106, 3}};
  options_.frames = {101};
  run();
  options_.existing = ExistingFiles::kSkip;
  EXPECT_EQ(run().rendered, 0);
  focus.keys.back().depth = 4;
  EXPECT_EQ(run().rendered, 1);
  shot_.output.motion_samples = 1;
  run();
  focus.keys.back().depth = 5;
  EXPECT_EQ(run().rendered, 0) << "a sharp frame has its own focus only";
}

// Frames of a shot that begins at 0, and shutters that are open for several frames.
TEST_F(MotionBlur, OfLightFieldsBeginsBeforeTheFirstFrame) {
  keep_camera_still();
  shot_.camera.keys[0].position = {{0.03, -0.03, 0}};
  shot_.camera.keys[0].shutter_deg = 1440;
  shot_.first_frame = shot_.last_frame = 0;
  shot_.camera.keys[0].frame = 0;
  shot_.layers.front().time = Layer::Time::kExact;
  shot_.layers.front().start_seconds = 0.25;
  run();
  double mean = 0;
  constexpr int kTimes = 1000;
  for (int t = 0; t < kTimes; ++t) {
    const double ticks = 0.5 + 4 * (t + 0.5) / kTimes;
    mean += linear_from_srgb((testing::kFirstGrey + testing::kStep * ticks) / 255) / kTimes;
  }
  EXPECT_NEAR(middle(0).first, mean, 0.002);
}

TEST_F(MotionBlur, BytesDoNotDependOnThreadsAndOrder) {
  add_square();
  shot_.layers.front().time = Layer::Time::kExact;
  shot_.output.cryptomatte = true;
  run();
  std::vector<std::string> bytes;
  for (int frame = 101; frame <= 106; ++frame) bytes.push_back(read_file(file(frame)));
  options_.frames_in_flight = 3;
  tbb::task_arena one(1);
  one.execute([&] { run(); });
  for (int frame = 101; frame <= 106; ++frame) {
    EXPECT_EQ(read_file(file(frame)), bytes[frame - 101]) << frame;
  }
}

// At the ends of a take the shutter is open before its first, or after its last instant.
TEST_F(MotionBlur, ShowsTheFramesInstantBeyondTheTake) {
  shot_.layers.front().time = Layer::Time::kExact;
  shot_.camera.keys[0].shutter_deg = 360;
  run();
  const float first = middle(101).first, last = middle(106).first;
  EXPECT_GT(first, grey(0) - 0.002F);
  EXPECT_LT(first, (grey(0) + grey(1)) / 2);
  EXPECT_LT(last, grey(5) + 0.002F);
  EXPECT_GT(last, (grey(4) + grey(5)) / 2);
}

}  // namespace
}  // namespace raystage::compose
