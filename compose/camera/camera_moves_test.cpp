// SPDX-License-Identifier: Apache-2.0
// Camera motion beyond keys: targets, orbits, dolly zoom, stereo, camera files.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "base/atomic_file.h"
#include "base/error.h"
#include "compose/camera/camera_export.h"
#include "compose/camera/shot_camera.h"
#include "testing/test_folder.h"

namespace raystage::compose {
namespace {

using Eigen::Vector3d;
using Key = schemas::ShotDocument::CameraKey;
using ::testing::HasSubstr;

constexpr double kDegrees = std::numbers::pi / 180;

class CameraMoves : public ::testing::Test {
 protected:
  CameraMoves() {
    shot_.width = 960;
    shot_.height = 540;
    shot_.fps = shot_.fps_numerator = 25;
    shot_.first_frame = 101;
    shot_.last_frame = 150;
  }
  ShotCamera camera() const { return {shot_, folder_.path() / "shot.json"}; }
  std::string refusal() const {
    try {
      const ShotCamera made = camera();
      for (int frame = shot_.first_frame; frame <= shot_.last_frame; ++frame) made.state(frame);
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      return error.what();
    }
    return "none";
  }
  /// Returns the pixels right and down of the top left corner.
  static Eigen::Vector2d image_of(const render::VirtualCamera& view, const Vector3d& point) {
    const Vector3d x = view.pose.camera_from_world(point);
    const schemas::Intrinsics& k = view.intrinsics;
    return {k.cx + k.fx * x.x() / -x.z(), k.cy - k.fy * x.y() / -x.z()};
  }

  schemas::ShotDocument shot_;
  testing::TestFolder folder_;
};

TEST_F(CameraMoves, EachPropertyHasItsOwnKeys) {
  shot_.camera.film_back_mm = 24;
  shot_.camera.keys = {{.frame = 101, .position = {{0, 0, 0}}, .focal_length_mm = 35},
                       {.frame = 111, .focus_m = 2, .f_number = 2.8},
                       {.frame = 121, .position = {{2, 0, 0}}},
                       {.frame = 131, .focus_m = 4, .shutter_deg = 180}};
  const CameraState state = camera().state(121);
  EXPECT_EQ(state.pose.position, Vector3d(2, 0, 0));
  EXPECT_NEAR(camera().state(111).pose.position.x(), 1, 1e-12);
  EXPECT_DOUBLE_EQ(*state.focus_m, 3);
  EXPECT_EQ(state.f_number, 2.8);
  EXPECT_EQ(state.shutter_deg, 180);
  EXPECT_DOUBLE_EQ(state.focal_length_mm, 35);
  EXPECT_DOUBLE_EQ(state.horizontal_fov(), 2 * std::atan(12.0 / 35));
  EXPECT_NEAR(camera().camera(121).intrinsics.fx, 960 * 35 / 24.0, 1e-9);
  EXPECT_EQ(state.pose.world_from_camera_rotation, Eigen::Matrix3d::Identity());
}

TEST_F(CameraMoves, LooksAtATargetWithALevelHorizon) {
  shot_.camera.keys = {
      {.frame = 101, .position = {{1, 2, 3}}, .horizontal_fov_deg = 50, .target = {{-4, 1, -6}}},
      {.frame = 150, .position = {{-5, 2.5, 3}}, .target = {{-4, 0, -6}}}};
  for (const double frame : {101.0, 120.5, 150.0}) {
    const render::VirtualCamera view = camera().camera(frame);
    const Eigen::Matrix3d& r = view.pose.world_from_camera_rotation;
    EXPECT_NEAR(r.determinant(), 1, 1e-12);
    EXPECT_NEAR(r.col(0).y(), 0, 1e-12);
    EXPECT_GT(r.col(1).y(), 0);
    const Vector3d target(-4, 1 - (frame - 101) / 49, -6);
    EXPECT_LT((image_of(view, target) - Eigen::Vector2d(480, 270)).norm(), 1e-9);
  }
}

TEST_F(CameraMoves, RollTurnsClockwise) {
  shot_.camera.keys = {
      {.frame = 101, .position = {{0, 0, 0}}, .horizontal_fov_deg = 50, .roll_deg = 10}};
  // The camera's up vector leans to the right, so that vertical objects lean to the left.
  EXPECT_GT(camera().state(101).pose.world_from_camera_rotation(0, 1), 0);
  const render::VirtualCamera view = camera().camera(101);
  EXPECT_LT(image_of(view, {0, 1, -5}).x(), image_of(view, {0, 0, -5}).x());
}

TEST_F(CameraMoves, StraightDownIsARotationToo) {
  const Eigen::Matrix3d down = look_at_rotation({0, 3, 0}, {0, 0, 0});
  EXPECT_NEAR(down.determinant(), 1, 1e-12);
  EXPECT_LT((-down.col(2) - -Vector3d::UnitY()).norm(), 1e-12);
}

TEST_F(CameraMoves, AnOrbitKeepsDistanceAndTarget) {
  const Vector3d centre(0.5, 1, -4);
  shot_.camera.orbit = schemas::ShotDocument::Orbit{.center = {0.5, 1, -4}};
  shot_.camera.keys = {{.frame = 101,
                        .position = {{0.5, 1.5, 0}},
                        .horizontal_fov_deg = 40,
                        .target = {{0.5, 1, -4}},
                        .orbit_deg = -30},
                       {.frame = 150, .orbit_deg = 60}};
  const double radius = (Vector3d(0.5, 1.5, 0) - centre).norm();
  for (int frame = 101; frame <= 150; ++frame) {
    const render::VirtualCamera view = camera().camera(frame);
    EXPECT_NEAR((view.pose.position - centre).norm(), radius, 1e-12);
    EXPECT_NEAR(view.pose.position.y(), 1.5, 1e-12);
    EXPECT_LT((image_of(view, centre) - Eigen::Vector2d(480, 270)).norm(), 1e-9);
  }
  // Right-handed about y: from +z, where the camera starts, towards +x.
  const Vector3d last = camera().state(150).pose.position - centre;
  EXPECT_NEAR(std::atan2(last.x(), last.z()), 60 * kDegrees, 1e-12);
}

TEST_F(CameraMoves, VertigoKeepsItsTargetsSize) {
  shot_.camera.keys = {{.frame = 101, .position = {{0, 1, 2}}, .horizontal_fov_deg = 20},
                       {.frame = 120, .position = {{0.2, 1, -1}}},
                       {.frame = 150, .position = {{0, 1.1, 1}}}};
  shot_.camera.dolly_zoom = schemas::ShotDocument::DollyZoom{.target = {0.1, 1, -5}};
  const Vector3d target(0.1, 1, -5), top = target + Vector3d(0, 0.9, 0);
  const auto size = [&](const render::VirtualCamera& view) {
    return (image_of(view, top) - image_of(view, target)).norm();
  };
  const double first = size(camera().camera(101));
  double narrowest = 1e9, widest = 0;
  for (double frame = 101; frame <= 150; frame += 0.5) {
    const render::VirtualCamera view = camera().camera(frame);
    EXPECT_NEAR(size(view) / first, 1, 1e-12) << frame;
    narrowest = std::min(narrowest, view.intrinsics.fx);
    widest = std::max(widest, view.intrinsics.fx);
    // Thesis eq. 7.1; d: the target's depth.
    const CameraState state = camera().state(frame);
    const double d = -5, from = 2, fov = 20 * kDegrees;
    EXPECT_NEAR(std::tan(state.horizontal_fov() / 2),
                (d - from) / (d - state.pose.position.z()) * std::tan(fov / 2), 1e-12);
  }
  EXPECT_GT(widest / narrowest, 1.5);
}

TEST_F(CameraMoves, VertigoTakesItsSizeFromTheFrameItIsTold) {
  shot_.camera.keys = {{.frame = 101, .position = {{0, 0, 2}}, .horizontal_fov_deg = 20},
                       {.frame = 150, .position = {{0, 0, 0}}}};
  shot_.camera.dolly_zoom = schemas::ShotDocument::DollyZoom{.target = {0, 0, -4}, .frame = 150};
  EXPECT_NEAR(camera().state(150).horizontal_fov(), 20 * kDegrees, 1e-12);
  EXPECT_LT(camera().state(101).horizontal_fov(), 20 * kDegrees);
}

TEST_F(CameraMoves, ALensShiftMovesThePicture) {
  shot_.camera.keys = {{.frame = 101,
                        .position = {{0, 0, 0}},
                        .horizontal_fov_deg = 45,
                        .shift_x = 0.25,
                        .shift_y = 0.125},
                       {.frame = 111, .shift_x = 0}};
  // The axis is a quarter of the width to the left of the picture's centre, and an eighth below.
  const Eigen::Vector2d axis = image_of(camera().camera(101), Vector3d(0, 0, -3));
  EXPECT_NEAR(axis.x(), 480 - 240, 1e-9);
  EXPECT_NEAR(axis.y(), 270 + 120, 1e-9);
  EXPECT_NEAR(image_of(camera().camera(106), Vector3d(0, 0, -3)).x(), 480 - 120, 1e-9);
}

TEST_F(CameraMoves, StereoEyesConvergeByShift) {
  shot_.camera.keys = {
      {.frame = 101, .position = {{0, 0, 0}}, .horizontal_fov_deg = 45, .target = {{3, 0, -4}}}};
  shot_.camera.stereo = schemas::ShotDocument::Stereo{.interaxial_m = 0.1};
  ShotCamera eyes = camera();
  EXPECT_EQ(eyes.eyes(), (std::vector{Eye::kLeft, Eye::kRight}));
  const auto both = [&](const Vector3d& point) {
    return std::pair(image_of(eyes.camera(101, Eye::kLeft), point),
                     image_of(eyes.camera(101, Eye::kRight), point));
  };
  const Vector3d axis = Vector3d(3, 0, -4).normalized(), right = Vector3d(4, 0, 3).normalized();
  const render::VirtualCamera left = eyes.camera(101, Eye::kLeft);
  EXPECT_LT((left.pose.position - -0.05 * right).norm(), 1e-12);
  EXPECT_EQ(left.pose.world_from_camera_rotation,
            eyes.camera(101, Eye::kRight).pose.world_from_camera_rotation);
  // Parallel eyes: infinity has no disparity; near points are further right for the left eye.
  auto [far_left, far_right] = both(axis * 1e9);
  EXPECT_NEAR(far_left.x(), far_right.x(), 1e-5);
  auto [near_left, near_right] = both(axis * 2);
  EXPECT_NEAR(near_left.x() - near_right.x(), left.intrinsics.fx * 0.1 / 2, 1e-9);

  shot_.camera.stereo->convergence_m = 2;
  eyes = camera();
  for (const Vector3d& point : {Vector3d(axis * 2), Vector3d(axis * 2 + 0.3 * right)}) {
    const auto [l, r] = both(point);
    EXPECT_LT((l - r).norm(), 1e-9);
  }
  EXPECT_NEAR(both(axis * 2).first.x(), 480, 1e-9);
  EXPECT_GT(both(axis).first.x(), both(axis).second.x());
  EXPECT_LT(both(axis * 50).first.x(), both(axis * 50).second.x());
}

TEST_F(CameraMoves, ChanAndGltfGiveBackTheCameraTheyWereMadeOf) {
  shot_.camera.keys = {{.frame = 101,
                        .position = {{0, 1, 2}},
                        .horizontal_fov_deg = 50,
                        .target = {{0, 1, -4}},
                        .roll_deg = 0},
                       {.frame = 130, .position = {{1, 1.2, 1}}, .horizontal_fov_deg = 35},
                       {.frame = 150, .position = {{2, 1, 0}}, .roll_deg = 15}};
  const ShotCamera original = camera();
  std::vector<int> frames;
  for (int frame = 101; frame <= 150; ++frame) frames.push_back(frame);
  write_file_atomically(folder_.path() / "move.chan",
                        camera_to_chan(original, frames, Eye::kBoth, RotationOrder::kYxz));
  write_file_atomically(folder_.path() / "move.gltf",
                        camera_to_gltf(original, shot_, frames, Eye::kBoth, "c"));

  shot_.camera.keys.clear();
  for (const char* name : {"move.chan", "move.gltf"}) {
    shot_.camera.file = {.path = name, .rotation_order = "YXZ"};
    const ShotCamera again = camera();
    EXPECT_EQ(again.files().size(), 1U);
    for (int frame = 101; frame <= 150; ++frame) {
      const render::VirtualCamera a = original.camera(frame), b = again.camera(frame);
      EXPECT_LT((a.pose.position - b.pose.position).norm(), 1e-6) << name;
      EXPECT_LT((a.pose.world_from_camera_rotation - b.pose.world_from_camera_rotation).norm(),
                1e-6);
      EXPECT_NEAR(a.intrinsics.fx / b.intrinsics.fx, 1, 1e-6);
    }
    shot_.camera.file->frame_offset = 10;  // later
    EXPECT_LT((camera().state(130).pose.position - original.state(120).pose.position).norm(), 1e-6);
  }
}

TEST_F(CameraMoves, ANukeScriptHasTheCameraWithItsShift) {
  shot_.camera.film_back_mm = 24;
  shot_.camera.keys = {
      {.frame = 101, .position = {{0, 1, 2}}, .focal_length_mm = 48, .focus_m = 4, .f_number = 2.8},
      {.frame = 102, .position = {{1, 1, 2}}}};
  shot_.camera.stereo = {.interaxial_m = 0.08, .convergence_m = 4};
  const ShotCamera original = camera();
  const std::vector<int> frames{101, 102};
  const std::string left = format_camera_file(
      {original, shot_, frames, Eye::kLeft, RotationOrder::kZxy, "2nd unit"}, "a.nk");
  EXPECT_THAT(left, HasSubstr("Camera2 {\n"));
  EXPECT_THAT(left, HasSubstr(" translate {{curve x101 -0.04 x102 0.96} {curve x101 1 x102 1}"));
  EXPECT_THAT(left, HasSubstr(" rotate {{curve x101 0 x102 0}"));
  EXPECT_THAT(left, HasSubstr(" haperture 24\n"));
  EXPECT_THAT(left, HasSubstr(" focal_point {{curve x101 4 x102 4}}"));
  EXPECT_THAT(left, HasSubstr(" fstop {{curve x101 2.8 x102 2.8}}"));
  EXPECT_THAT(left, HasSubstr(" name camera_2nd_unit\n}\n"));
  // The left eye's picture is shifted to the right: 0.04 m at 4 m by 48 mm on half of 24 mm.
  const render::VirtualCamera view = original.camera(101, Eye::kLeft);
  EXPECT_NEAR(1 - 2 * view.intrinsics.cx / view.width, 0.04 / 4 * 48 / 12, 1e-12);
  EXPECT_THROW(format_camera_file({original, shot_, frames}, "a.fbx"), Error);
}

TEST_F(CameraMoves, AFileAndKeysAddUpButDoNotContradict) {
  write_file_atomically(folder_.path() / "move.chan", "101 0 0 0 0 0 0\n150 1 0 0 0 0 0\n");
  shot_.camera.file = {.path = "move.chan"};
  EXPECT_THAT(refusal(), HasSubstr("no focal length"));
  shot_.camera.keys = {{.frame = 101, .focal_length_mm = 50, .focus_m = 3}};
  EXPECT_EQ(refusal(), "none");
  EXPECT_EQ(camera().state(150).focus_m, 3);
  shot_.camera.keys[0].position = {{0, 0, 0}};
  EXPECT_THAT(refusal(), HasSubstr("both the camera file and the keys give the position"));
}

TEST_F(CameraMoves, RefusesWhatCannotBe) {
  EXPECT_THAT(refusal(), HasSubstr("shot.json#/camera: the camera has no position"));
  const Key key{.frame = 101, .position = {{0, 0, 0}}, .horizontal_fov_deg = 40};
  shot_.camera.keys = {key};
  shot_.camera.keys[0].orbit_deg = 10;
  EXPECT_THAT(refusal(), HasSubstr("keys with orbit_deg; one is missing"));
  shot_.camera.keys = {key};
  shot_.camera.keys[0].target = {{0, 0, 0}};
  EXPECT_THAT(refusal(), HasSubstr("at frame 101 the camera is at its target"));
  shot_.camera.keys = {key};
  shot_.camera.dolly_zoom = schemas::ShotDocument::DollyZoom{.target = {0, 0, 1}};
  EXPECT_THAT(refusal(), HasSubstr("behind the camera"));
  shot_.camera.dolly_zoom->target = {0, 0, -1};
  shot_.camera.keys.push_back({.frame = 150, .position = {{0, 0, -2}}});
  EXPECT_THAT(refusal(), HasSubstr("at frame 126 the target of dolly_zoom is not in front"));
  shot_.camera.dolly_zoom.reset();
  shot_.camera.file = {.path = "gone.chan"};
  EXPECT_THAT(refusal(), HasSubstr("gone.chan"));
}

}  // namespace
}  // namespace raystage::compose
