// SPDX-License-Identifier: Apache-2.0
#include "compose/camera/gltf_timing.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <vector>

#include "base/error.h"

namespace raystage::compose {
namespace {

constexpr FrameRate kFilm{24000, 1001};

/// Times of frames as a file has them: float.
std::vector<double> times_of(int first, int last, double fps) {
  std::vector<double> times;
  for (int frame = first; frame <= last; ++frame) {
    times.push_back(double{static_cast<float>(frame / fps)});
  }
  return times;
}

double fps_of(const std::vector<double>& times, FrameRate shot) {
  return gltf_frames({shot, false, {}}, times, "move.glb", "shot.json#/camera/file", "Add fps").fps;
}

TEST(GltfFrames, AFileWithoutARateHasThatOfTheShotOrTheNominalOne) {
  // Both rates have keys near frames for as long as the shot is short.
  for (const int last : {1002, 1003, 1008, 1012, 1100, 2000}) {
    EXPECT_EQ(fps_of(times_of(1001, last, 24), kFilm), 24) << last;
    EXPECT_EQ(fps_of(times_of(1001, last, kFilm.fps()), kFilm), kFilm.fps()) << last;
  }
  for (const int last : {2, 5, 100, 5000, 20000}) {
    EXPECT_EQ(fps_of(times_of(1, last, 24), kFilm), 24) << last;
    EXPECT_EQ(fps_of(times_of(1, last, kFilm.fps()), kFilm), kFilm.fps()) << last;
    EXPECT_EQ(fps_of(times_of(1, last, 25), {25, 1}), 25) << last;
  }
  EXPECT_EQ(fps_of({}, kFilm), kFilm.fps());
  EXPECT_EQ(fps_of({0}, kFilm), kFilm.fps());
}

TEST(GltfFrames, KeysBetweenFramesAreRefusedWithTheRateThatFits) {
  try {
    fps_of(times_of(1, 20, 25), {24, 1});
    FAIL() << "25 fps passed for 24";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("they are frames at 25 fps"));
    EXPECT_THAT(error.what(), ::testing::HasSubstr("shot.json#/camera/file"));
  }
}

TEST(GltfFrames, AStatedFirstFrameMovesTheZero) {
  const GltfFrames frames =
      gltf_frames({{24, 1}, true, 1001}, times_of(0, 3, 24), "move.glb", "here", "Correct it");
  EXPECT_DOUBLE_EQ(frames.seconds(1001), 0);
  EXPECT_EQ(frames.frame(double{static_cast<float>(2 / 24.0)}), 1003);
}

}  // namespace
}  // namespace raystage::compose
