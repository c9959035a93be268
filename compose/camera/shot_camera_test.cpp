// SPDX-License-Identifier: Apache-2.0
#include "compose/camera/shot_camera.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <cmath>
#include <numbers>

#include "base/error.h"

namespace raystage::compose {
namespace {

using Key = schemas::ShotDocument::CameraKey;
using Eigen::AngleAxisd;
using Eigen::Quaterniond;
using Eigen::Vector3d;

Key make_key(double frame, const Vector3d& position, const Quaterniond& q, double fov) {
  return {.frame = frame,
          .position = std::array{position.x(), position.y(), position.z()},
          .orientation = std::array{q.w(), q.x(), q.y(), q.z()},
          .horizontal_fov_deg = fov};
}

/// Returns the camera of a shot of these keys, 640x360.
ShotCamera camera_of(const std::vector<Key>& keys) {
  schemas::ShotDocument shot;
  shot.width = 640;
  shot.height = 360;
  shot.camera.keys = keys;
  return {shot, "shot.json"};
}

Quaterniond turned(double degrees, const Vector3d& axis) {
  return Quaterniond(AngleAxisd(degrees * std::numbers::pi / 180, axis.normalized()));
}

/// Generates keys with uneven spacing, positions of very different distances, any rotations and
/// signs.
std::vector<Key> arbitrary_keys() {
  const int count = *rc::gen::inRange(2, 7);
  std::vector<Key> keys;
  double frame = *rc::gen::inRange(-20, 20);
  const auto number = [] { return *rc::gen::inRange(-1000, 1001) * 1e-2; };
  for (int i = 0; i < count; ++i) {
    Quaterniond q(number() + 0.001, number(), number(), number());
    q.normalize();
    keys.push_back(
        make_key(frame, {number(), number(), number() * 100}, q, *rc::gen::inRange(5, 150)));
    frame += *rc::gen::element(0.5, 1.0, 7.0, 300.0);
  }
  return keys;
}

rig::Pose pose_at(const ShotCamera& camera, double frame) { return camera.state(frame).pose; }
double fov_at(const ShotCamera& camera, double frame) {
  return camera.state(frame).horizontal_fov();
}

double rotation_between(const Eigen::Matrix3d& a, const Eigen::Matrix3d& b) {
  return AngleAxisd(a.transpose() * b).angle();
}

TEST(ShotCameraKeys, PassesExactlyThroughItsKeys) {
  EXPECT_TRUE(rc::check([] {
    const auto keys = arbitrary_keys();
    const ShotCamera camera = camera_of(keys);
    for (const Key& key : keys) {
      const rig::Pose pose = pose_at(camera, key.frame);
      const auto& o = *key.orientation;
      const Quaterniond q(o[0], o[1], o[2], o[3]);
      RC_ASSERT((pose.position - Vector3d(key.position->data())).norm() < 1e-12);
      RC_ASSERT((pose.world_from_camera_rotation - q.toRotationMatrix()).norm() < 1e-12);
      RC_ASSERT(std::abs(fov_at(camera, key.frame) -
                         *key.horizontal_fov_deg * std::numbers::pi / 180) < 1e-12);
      // And arrives there from the left.
      RC_ASSERT((pose_at(camera, key.frame - 1e-9).position - pose.position).norm() < 1e-4);
      RC_ASSERT(rotation_between(pose_at(camera, key.frame - 1e-9).world_from_camera_rotation,
                                 pose.world_from_camera_rotation) < 1e-6);
    }
  }));
}

TEST(ShotCameraKeys, RotationsStayRotationsAndNothingBlowsUp) {
  EXPECT_TRUE(rc::check([] {
    const auto keys = arbitrary_keys();
    const ShotCamera camera = camera_of(keys);
    for (std::size_t i = 0; i + 1 < keys.size(); ++i) {
      const Vector3d a(keys[i].position->data()), b(keys[i + 1].position->data());
      const double low = std::min(*keys[i].horizontal_fov_deg, *keys[i + 1].horizontal_fov_deg);
      const double high = std::max(*keys[i].horizontal_fov_deg, *keys[i + 1].horizontal_fov_deg);
      for (double u = 0; u <= 1; u += 1.0 / 16) {
        const double frame = keys[i].frame + u * (keys[i + 1].frame - keys[i].frame);
        const rig::Pose pose = pose_at(camera, frame);
        const Eigen::Matrix3d& r = pose.world_from_camera_rotation;
        RC_ASSERT((r.transpose() * r - Eigen::Matrix3d::Identity()).norm() < 1e-12);
        RC_ASSERT(std::abs(r.determinant() - 1) < 1e-12);
        // The documented bound of the distance from the straight line between the keys.
        const Vector3d chord = b - a;
        const double along =
            chord.squaredNorm() > 0
                ? std::clamp((pose.position - a).dot(chord) / chord.squaredNorm(), 0.0, 1.0)
                : 0;
        RC_ASSERT((pose.position - a - along * chord).norm() <= 0.375 * chord.norm() + 1e-9);
        const double fov = fov_at(camera, frame) * 180 / std::numbers::pi;
        RC_ASSERT(fov >= low - 1e-9);
        RC_ASSERT(fov <= high + 1e-9);
      }
    }
  }));
}

TEST(ShotCameraKeys, SpeedIsContinuousAtInnerKeys) {
  EXPECT_TRUE(rc::check([] {
    const auto keys = arbitrary_keys();
    const ShotCamera camera = camera_of(keys);
    constexpr double kStep = 1e-5;
    for (std::size_t i = 1; i + 1 < keys.size(); ++i) {
      const double frame = keys[i].frame;
      const rig::Pose before = pose_at(camera, frame - kStep), at = pose_at(camera, frame),
                      after = pose_at(camera, frame + kStep);
      // Differences over a step include half the acceleration of either side. A cubic whose end
      // slopes are at most 1.5 times its chord's accelerates by at most 15 chords per interval
      // squared. A jump in speed would be thousands of times larger than this bound.
      double acceleration = 0, turning = 0;
      for (const std::size_t from : {i - 1, i}) {
        const double h = keys[from + 1].frame - keys[from].frame;
        const double chord = (pose_at(camera, keys[from + 1].frame).position -
                              pose_at(camera, keys[from].frame).position)
                                 .norm();
        acceleration = std::max(acceleration, 15 * chord / (h * h));
        turning = std::max(turning, 15 * std::numbers::pi / (h * h));
      }
      const Vector3d in = (at.position - before.position) / kStep;
      const Vector3d out = (after.position - at.position) / kStep;
      RC_ASSERT((in - out).norm() < acceleration * kStep + 1e-5);

      const AngleAxisd spin_in(before.world_from_camera_rotation.transpose() *
                               at.world_from_camera_rotation);
      const AngleAxisd spin_out(at.world_from_camera_rotation.transpose() *
                                after.world_from_camera_rotation);
      RC_ASSERT((spin_in.axis() * spin_in.angle() - spin_out.axis() * spin_out.angle()).norm() /
                    kStep <
                turning * kStep + 1e-5);
    }
  }));
}

TEST(ShotCameraKeys, TwoKeysGiveConstantSpeed) {
  const ShotCamera camera =
      camera_of(std::vector<Key>{make_key(1, {0, 0, 0}, Quaterniond::Identity(), 40),
                                 make_key(5, {4, 0, 8}, turned(100, Vector3d::UnitY()), 40)});
  for (const double frame : {1.0, 1.5, 2.0, 4.25}) {
    EXPECT_NEAR(pose_at(camera, frame).position.x(), frame - 1, 1e-12);
    EXPECT_NEAR(rotation_between(Eigen::Matrix3d::Identity(),
                                 pose_at(camera, frame).world_from_camera_rotation),
                (frame - 1) * 25 * std::numbers::pi / 180, 1e-12);
  }
}

TEST(ShotCameraKeys, UnevenKeysOnASteadyMoveKeepItSteady) {
  std::vector<Key> keys;
  for (const double frame : {0.0, 1.0, 30.0, 34.0}) {
    keys.push_back(make_key(frame, {frame, -2 * frame, 0}, turned(3 * frame, {1, 2, 0}), 40));
  }
  const ShotCamera camera = camera_of(keys);
  for (double frame = 0; frame <= 34; frame += 0.25) {
    const rig::Pose pose = pose_at(camera, frame);
    EXPECT_NEAR((pose.position - Vector3d(frame, -2 * frame, 0)).norm(), 0, 1e-12);
    EXPECT_NEAR(rotation_between(turned(3 * frame, {1, 2, 0}).toRotationMatrix(),
                                 pose.world_from_camera_rotation),
                0, 1e-7);
  }
}

TEST(ShotCameraKeys, RestsBeforeTheFirstAndAfterTheLastKey) {
  const ShotCamera camera =
      camera_of(std::vector<Key>{make_key(10, {1, 2, 3}, Quaterniond::Identity(), 40),
                                 make_key(20, {4, 5, 6}, turned(30, Vector3d::UnitX()), 60)});
  EXPECT_EQ(pose_at(camera, -100).position, Vector3d(1, 2, 3));
  EXPECT_EQ(pose_at(camera, 20.5).position, Vector3d(4, 5, 6));
  EXPECT_NEAR(fov_at(camera, 1000), std::numbers::pi / 3, 1e-12);
}

TEST(ShotCameraKeys, RestsBetweenEqualKeys) {
  const ShotCamera camera =
      camera_of(std::vector<Key>{make_key(1, {0, 0, 0}, Quaterniond::Identity(), 40),
                                 make_key(100, {0, 0, 0}, Quaterniond::Identity(), 40),
                                 make_key(101, {9, 0, 0}, turned(90, Vector3d::UnitY()), 20)});
  EXPECT_EQ(pose_at(camera, 60).position, Vector3d::Zero());
  EXPECT_NEAR(fov_at(camera, 99), 40 * std::numbers::pi / 180, 1e-12);
}

TEST(ShotCameraKeys, OneKeyStandsStill) {
  const ShotCamera camera =
      camera_of(std::vector<Key>{make_key(7, {1, 0, 0}, turned(12, {1, 2, 3}), 33)});
  EXPECT_EQ(pose_at(camera, -3).position, pose_at(camera, 44).position);
  const render::VirtualCamera view = camera.camera(12);
  EXPECT_EQ(view.width, 640);
  EXPECT_NEAR(view.intrinsics.fx, 320 / std::tan(33 * std::numbers::pi / 360), 1e-9);
  EXPECT_NEAR(view.intrinsics.fy, view.intrinsics.fx, 1e-12);
  EXPECT_EQ(view.intrinsics.cx, 320);
  EXPECT_EQ(view.intrinsics.cy, 180);
}

TEST(ShotCameraKeys, TakesTheShortWayRoundWhateverTheSigns) {
  Quaterniond flipped = turned(20, Vector3d::UnitY());
  flipped.coeffs() = -flipped.coeffs();
  const ShotCamera camera = camera_of(std::vector<Key>{
      make_key(0, {0, 0, 0}, Quaterniond::Identity(), 40), make_key(2, {0, 0, 0}, flipped, 40)});
  EXPECT_NEAR(
      rotation_between(Eigen::Matrix3d::Identity(), pose_at(camera, 1).world_from_camera_rotation),
      10 * std::numbers::pi / 180, 1e-12);
}

TEST(ShotCameraKeys, ADollyZoomKeepsTheSizeOfItsSubject) {
  // The subject is at the origin; the camera moves back from 2 m to 8 m.
  const auto fov = [](double distance) {
    return 2 * std::atan(1.0 / distance) * 180 / std::numbers::pi;
  };
  const ShotCamera camera =
      camera_of(std::vector<Key>{make_key(1, {0, 0, 2}, Quaterniond::Identity(), fov(2)),
                                 make_key(31, {0, 0, 3}, Quaterniond::Identity(), fov(3)),
                                 make_key(49, {0, 0, 8}, Quaterniond::Identity(), fov(8))});
  for (double frame = 1; frame <= 49; frame += 0.5) {
    const double half_width_seen =
        std::tan(fov_at(camera, frame) / 2) * pose_at(camera, frame).position.z();
    EXPECT_NEAR(half_width_seen, 1, 1e-12) << "frame " << frame;
  }
}

TEST(ShotCameraKeys, EaseSlowsDownOneSideAndTensionBoth) {
  Key first = make_key(0, {0, 0, 0}, Quaterniond::Identity(), 40);
  Key last = make_key(10, {10, 0, 0}, turned(90, Vector3d::UnitY()), 40);
  const auto x = [&](double frame) {
    return pose_at(camera_of({first, last}), frame).position.x();
  };
  const auto angle = [&](double frame) {
    return rotation_between(Eigen::Matrix3d::Identity(),
                            pose_at(camera_of({first, last}), frame).world_from_camera_rotation) *
           180 / std::numbers::pi;
  };
  EXPECT_NEAR(x(2.5), 2.5, 1e-12);
  first.ease_out = 1;  // starts from rest
  EXPECT_LT(x(0.1), 0.01);
  EXPECT_NEAR((x(10) - x(9.9)) / 0.1, 1, 0.02);
  EXPECT_LT(angle(0.1), 0.1);
  EXPECT_NEAR((angle(10) - angle(9.9)) / 0.1, 9, 0.2);
  last.ease_in = 1;  // and comes to rest: 3 u^2 - 2 u^3
  EXPECT_NEAR(x(2.5), 10 * 0.15625, 1e-12);
  EXPECT_NEAR(x(5), 5, 1e-12);
  EXPECT_NEAR(angle(5), 45, 1e-9);
  first.ease_out = last.ease_in = 0;
  first.tension = last.tension = 1;
  EXPECT_NEAR(x(2.5), 10 * 0.15625, 1e-12);
  first.tension = last.tension = 0.5;
  EXPECT_NEAR(x(2.5), 0.5 * (2.5 + 10 * 0.15625), 1e-12);
  EXPECT_EQ(x(0), 0);
  EXPECT_EQ(x(10), 10);
}

TEST(ShotCameraKeys, RefusesUnusableKeys) {
  const Key good = make_key(1, {0, 0, 0}, Quaterniond::Identity(), 40);
  EXPECT_THROW(camera_of({}), Error);
  EXPECT_THROW(camera_of({good, good}), Error);
  Key bad = good;
  bad.orientation = {{0, 0, 0, 0}};
  EXPECT_THROW(camera_of({bad}), Error);
  bad = good;
  bad.horizontal_fov_deg = 180;
  EXPECT_THROW(camera_of({bad}), Error);
  bad = good;
  bad.position->at(1) = NAN;
  EXPECT_THROW(camera_of({bad}), Error);
  bad = good;
  bad.tension = 1.5;
  EXPECT_THROW(camera_of({bad}), Error);
  bad = good;
  bad.ease_in = -0.1;
  EXPECT_THROW(camera_of({bad}), Error);
}

}  // namespace
}  // namespace raystage::compose
