// SPDX-License-Identifier: Apache-2.0
#include "compose/camera/camera_keys.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

namespace raystage::compose {
namespace {

using Key = schemas::ShotDocument::CameraKey;

class CameraKeys : public ::testing::Test {
 protected:
  CameraKeys() {
    shot_.width = 960;
    shot_.height = 540;
    shot_.first_frame = 101;
    shot_.last_frame = 200;
  }
  /// Finds keys and returns how far their camera is from the path at most: metres and degrees.
  std::pair<double, double> largest_difference(const KeyTolerance& tolerance = {}) {
    const ShotCamera path(shot_, "shot.json");
    keys_ = find_camera_keys(path, shot_, tolerance);
    schemas::ShotDocument keyed = shot_;
    keyed.camera = keyed_camera(shot_.camera, keys_);
    const ShotCamera camera(keyed, "shot.json");
    std::pair<double, double> most{0, 0};
    for (int frame = shot_.first_frame; frame <= shot_.last_frame; ++frame) {
      const CameraState a = path.state(frame), b = camera.state(frame);
      most.first = std::max(most.first, (a.pose.position - b.pose.position).norm());
      most.second =
          std::max(most.second, Eigen::AngleAxisd(a.pose.world_from_camera_rotation.transpose() *
                                                  b.pose.world_from_camera_rotation)
                                        .angle() *
                                    180 / std::numbers::pi);
      EXPECT_NEAR(b.focal_length_mm, a.focal_length_mm,
                  1.0001 * tolerance.focal_length_share * a.focal_length_mm);
      EXPECT_EQ(a.focus_m.has_value(), b.focus_m.has_value());
      if (a.focus_m) {
        EXPECT_NEAR(1 / *b.focus_m, 1 / *a.focus_m, tolerance.focus_dioptres * 1.0001);
      }
    }
    return most;
  }

  schemas::ShotDocument shot_;
  std::vector<Key> keys_;
};

TEST_F(CameraKeys, ATargetBecomesOrientationsWithinTheTolerance) {
  shot_.camera.keys = {{.frame = 101,
                        .position = {{0, 0, 0}},
                        .focal_length_mm = 35,
                        .target = {{0, 0, -3}},
                        .focus_m = 3},
                       {.frame = 150, .position = {{1, 0.2, 0}}, .focus_m = 2},
                       {.frame = 200, .position = {{-1, 0, -1}}, .focal_length_mm = 70}};
  const auto [metres, degrees] = largest_difference();
  EXPECT_LE(metres, 0.0005 * 1.0001);
  EXPECT_LE(degrees, 0.02 * 1.0001);
  EXPECT_LT(keys_.size(), 30U) << "few enough to edit";
  for (const Key& key : keys_) EXPECT_FALSE(key.target);
  KeyTolerance coarse;
  coarse.position_m = 0.05;
  coarse.rotation_deg = 1;
  coarse.focal_length_share = 0.02;
  coarse.focus_dioptres = 0.05;
  const std::size_t fine = keys_.size();
  EXPECT_LE(largest_difference(coarse).first, 0.05 * 1.0001);
  EXPECT_LT(keys_.size(), fine);
}

TEST_F(CameraKeys, AnOrbitAndADollyZoomBecomeKeys) {
  shot_.camera.orbit = schemas::ShotDocument::Orbit{{0, 0, -4}, {0, 1, 0}};
  shot_.camera.keys = {
      {.frame = 101, .position = {{0, 0, 0}}, .focal_length_mm = 50, .orbit_deg = -30},
      {.frame = 200, .orbit_deg = 200}};
  const auto [metres, degrees] = largest_difference();
  EXPECT_LE(metres, 0.0005 * 1.0001);
  EXPECT_LE(degrees, 0.02 * 1.0001);
  shot_.camera.orbit.reset();
  shot_.camera.keys = {{.frame = 101, .position = {{0, 0, 0}}, .focal_length_mm = 50},
                       {.frame = 200, .position = {{0, 0, -2}}}};
  shot_.camera.dolly_zoom = schemas::ShotDocument::DollyZoom{{0, 0, -5}, {}};
  EXPECT_LE(largest_difference().first, 0.0005 * 1.0001);
}

TEST_F(CameraKeys, AShotThatStandsStillHasTwoKeysAndOneFrameHasOne) {
  shot_.camera.keys = {{.frame = 101, .position = {{1, 2, 3}}, .focal_length_mm = 35}};
  EXPECT_EQ(largest_difference().first, 0);
  EXPECT_EQ(keys_.size(), 2U);
  shot_.last_frame = 101;
  EXPECT_EQ(largest_difference().first, 0);
  EXPECT_EQ(keys_.size(), 1U);
}

TEST_F(CameraKeys, AJumpIsKeptWithAKeyPerFrameAtWorst) {
  shot_.camera.keys.clear();
  for (int i = 0; i < 100; ++i) {  // no smooth curve is close
    shot_.camera.keys.push_back(
        {.frame = 101.0 + i, .position = {{i % 2 == 0 ? 0.0 : 1.0, 0, 0}}, .focal_length_mm = 50});
  }
  EXPECT_LE(largest_difference().first, 0.0005 * 1.0001);
  EXPECT_EQ(keys_.size(), 100U);
}

}  // namespace
}  // namespace raystage::compose
