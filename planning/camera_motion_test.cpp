// SPDX-License-Identifier: Apache-2.0
#include "planning/camera_motion.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>

namespace raystage::planning {
namespace {

using ::testing::HasSubstr;

/// A camera that moves evenly along (3, 4, 0), sways by 0.1 m along z, and turns.
std::vector<FramePose> swaying_path(double metres_per_frame, double degrees_per_frame) {
  std::vector<FramePose> path;
  for (int i = 0; i <= 24; ++i) {
    rig::Pose pose;
    pose.position = Eigen::Vector3d(0.6, 0.8, 0) * (metres_per_frame * i);
    pose.position.z() = 0.1 * std::cos(std::numbers::pi * i / 12);
    pose.world_from_camera_rotation =
        Eigen::AngleAxisd(degrees_per_frame * i * std::numbers::pi / 180, Eigen::Vector3d::UnitY())
            .toRotationMatrix();
    path.push_back({101 + i, pose});
  }
  return path;
}

TEST(MeasureMotion, DividesSpeedIntoTrackAndArm) {
  const CameraMotion motion = measure_motion(swaying_path(0.05, 3), 24);
  EXPECT_NEAR(motion.track_length, 1.2, 0.02);
  EXPECT_NEAR(motion.reach, 0.2, 0.02);
  EXPECT_NEAR(motion.track_speed.value, 1.2, 0.05);
  const double sway = 0.1 * 2 * std::sin(std::numbers::pi / 24) * 24;  // around a zero
  EXPECT_NEAR(motion.extension_speed.value, sway, 0.08);
  EXPECT_NEAR(motion.turn_speed.value * 180 / std::numbers::pi, 72, 1e-9);
  EXPECT_NEAR(motion.acceleration.value, 0.1 * std::pow(std::numbers::pi / 12 * 24, 2), 0.05);
}

TEST(MeasureMotion, ComparesAdjacentFramesOnly) {
  std::vector<FramePose> path = swaying_path(0, 0);
  path.resize(2);
  path[1].frame = 110;
  path[1].pose.position.x() = 1e7;
  const CameraMotion motion = measure_motion(path, 24);
  EXPECT_EQ(motion.track_speed.value, 0);
  EXPECT_NEAR(motion.track_length, 1e7, 1);
  EXPECT_EQ(measure_motion(std::vector{path[0]}, 24).track_length, 0);
}

// Thesis 7.3.2: the rig's arm reaches 1 m, and it turns by 120 degrees a second.
TEST(ExceededLimits, AreThoseOfTheThesisRig) {
  const MotionLimits milo = milo_motion_limits();
  EXPECT_TRUE(exceeded_limits(measure_motion(swaying_path(0.05, 3), 12), milo).empty());
  const auto fast = exceeded_limits(measure_motion(swaying_path(0.05, 3), 96), milo);
  ASSERT_EQ(fast.size(), 3U);
  EXPECT_THAT(fast[0], HasSubstr("along the track is up to 4.8 m/s"));
  EXPECT_THAT(fast[1], HasSubstr("the rig does 0.38 m/s"));
  EXPECT_THAT(fast[2], HasSubstr("288 deg/s at frame"));
  // An arm that cannot reach: positions along an oblique track differ across it by rounding.
  std::vector<FramePose> straight = swaying_path(0, 0);
  for (std::size_t i = 0; i < straight.size(); ++i) {
    straight[i].pose.position = 0.01 * static_cast<double>(i) * Eigen::Vector3d(1, 0.3, 0.7);
  }
  const CameraMotion along = measure_motion(straight, 24);
  ASSERT_GT(along.reach, 0) << "no rounding: the test shows nothing";
  MotionLimits no_arm = milo;
  no_arm.reach = no_arm.extension_speed = no_arm.acceleration = 0;
  EXPECT_TRUE(exceeded_limits(along, no_arm).empty());
  EXPECT_FALSE(MotionLimits{}.is_limited());
  EXPECT_TRUE(exceeded_limits(measure_motion(swaying_path(9, 90), 1000), {}).empty());
}

}  // namespace
}  // namespace raystage::planning
