// SPDX-License-Identifier: Apache-2.0
// Compares a room with four light fields that look outwards from a volume at its centre.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numbers>

#include "compose/layers/cryptomatte.h"
#include "testing/compose/test_traced_scene.h"

namespace raystage::compose {
namespace {

using testing::TracedScene;

/// Returns a rotation about the y axis, counter-clockwise from above.
std::array<double, 4> turned(double degrees) {
  const double half = degrees * std::numbers::pi / 360;
  return {std::cos(half), 0, std::sin(half), 0};
}

/// Shared by all tests: takes of the room to the front, left, back and right.
class Immersive : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    room_ = std::make_unique<TracedScene>();
    write_room();
    schemas::ShotDocument seen = shot_looking(0);
    seen.layers = walls();
    for (schemas::ShotDocument::Layer& layer : seen.layers) layer.geometry->samples = 4;
    // The side of the volume is 0.4 m; planes extend by l / tan(A) (thesis, "Array layout").
    for (int side = 0; side < 4; ++side) {
      testing::TracedRig array{.turn_deg = 90.0 * side, .side = 3, .spacing = 0.25};
      array.width = 240;
      array.height = 180;
      const double angle = array.turn_deg * std::numbers::pi / 180;
      array.centre = {-0.2 * std::sin(angle), 0, -0.2 * std::cos(angle)};
      array.horizontal_fov_deg = 110;
      array.depth_range = {1.5, 8};
      room_->write_take("take" + std::to_string(side), seen, array);
    }
  }
  static void TearDownTestSuite() { room_.reset(); }

  /// Returns a room of 8 m with a ball in one of its corners.
  static std::vector<schemas::ShotDocument::Layer> walls() {
    return {TracedScene::mesh("walls", "room.obj", {0, 0, 0}, 4),
            TracedScene::mesh("ball", "ball.obj", {2, 0, -2}, 0.6)};
  }
  static void write_room() {
    std::ofstream room(room_->path("room.obj"));
    room << "o room\nvt 0 0\nvt 1 0\nvt 1 1\nvt 0 1\n";
    for (int corner = 0; corner < 8; ++corner) {
      room << "v " << (corner & 1 ? 1 : -1) << ' ' << (corner & 2 ? 1 : -1) << ' '
           << (corner & 4 ? 1 : -1) << '\n';
    }
    room << "f 1/1 2/2 4/3 3/4\nf 6/1 5/2 7/3 8/4\nf 5/1 1/2 3/3 7/4\n"
            "f 2/1 6/2 8/3 4/4\nf 5/1 6/2 2/3 1/4\nf 3/1 4/2 8/3 7/4\n";
  }

  /// Returns a shot of one view from within the volume.
  static schemas::ShotDocument shot_looking(double degrees) {
    schemas::ShotDocument shot;
    shot.width = 240;
    shot.height = 120;
    shot.merge = schemas::ShotDocument::Merge::kDepth;
    shot.camera.keys = {testing::camera_key(1, {0.08, 0.05, 0.06}, 80)};
    shot.camera.keys[0].orientation = turned(degrees);
    shot.lights = {{.ambient = {{0.9, 0.9, 0.9}}}};
    shot.output.cryptomatte = true;
    return shot;
  }
  static schemas::ShotDocument::Layer take(int side, const std::string& volume) {
    schemas::ShotDocument::Layer layer;
    layer.name = "side" + std::to_string(side);
    layer.take = "take" + std::to_string(side);
    layer.method = "depth";
    layer.volume = volume;
    return layer;
  }
  static std::vector<schemas::ShotDocument::Layer> takes() {
    return {take(0, "room"), take(1, "room"), take(2, "room"), take(3, "room")};
  }
  static double everywhere(const TracedScene::Picture& a, const TracedScene::Picture& b) {
    return TracedScene::psnr(a.image, b.image, [](std::size_t) { return true; });
  }

  static std::unique_ptr<TracedScene> room_;
};

std::unique_ptr<TracedScene> Immersive::room_;

TEST_F(Immersive, EveryRayIsAnsweredByATakeThatHoldsIt) {
  for (const double degrees : {0.0, -45.0, 110.0}) {
    SCOPED_TRACE(degrees);
    schemas::ShotDocument shot = shot_looking(degrees);
    shot.layers = walls();
    const TracedScene::Picture truth = room_->render(shot);
    shot.layers = takes();
    const TracedScene::Picture room = room_->render(shot);
    const double error = everywhere(truth, room);
    printf("a room from takes around a volume, %.0f degrees: %.2f dB\n", degrees, error);
    EXPECT_GT(error, 32);
    double open = 0;
    for (std::size_t i = 3; i < room.image.rgba.size(); i += 4) {
      open += 1 - double{room.image.rgba[i]};
    }
    EXPECT_LT(open, 1e-3 * static_cast<double>(room.image.rgba.size()) / 4);
    for (const float id : room.front) EXPECT_EQ(id, object_id("room"));
  }
}

TEST_F(Immersive, TheSeamIsNotSeen) {
  schemas::ShotDocument shot = shot_looking(-45);  // the seam is in the middle, and the ball
  shot.layers = walls();
  const TracedScene::Picture truth = room_->render(shot);
  shot.layers = takes();
  const TracedScene::Picture room = room_->render(shot);
  const auto column = [&](std::size_t pixel) {
    return static_cast<int>(pixel % static_cast<std::size_t>(shot.width));
  };
  const auto in_seam = [&](std::size_t pixel) {
    return std::abs(column(pixel) - shot.width / 2) < 12;
  };
  const double seam = TracedScene::psnr(truth.image, room.image, in_seam);
  const double rest = TracedScene::psnr(truth.image, room.image,
                                        [&](std::size_t pixel) { return !in_seam(pixel); });
  printf("in the seam %.2f dB, elsewhere %.2f dB\n", seam, rest);
  EXPECT_GT(seam, 34);  // all of the ball's edges are visible
  // For comparison: the takes as separate layers.
  for (schemas::ShotDocument::Layer& layer : shot.layers) layer.volume.clear();
  shot.merge = schemas::ShotDocument::Merge::kLayerOrder;
  EXPECT_LT(everywhere(truth, room_->render(shot)), everywhere(truth, room));
}

TEST_F(Immersive, OnePictureShowsAllDirections) {
  schemas::ShotDocument shot = shot_looking(30);
  shot.camera.projection = schemas::ShotDocument::Camera::Projection::kEquirectangular;
  shot.width = 360;
  shot.height = 180;
  shot.layers = walls();
  for (schemas::ShotDocument::Layer& layer : shot.layers) layer.geometry->samples = 16;
  const TracedScene::Picture truth = room_->render(shot);
  shot.layers = takes();
  const TracedScene::Picture room = room_->render(shot);
  // The cameras saw neither floor nor ceiling.
  const auto is_wall = [](std::size_t pixel) { return pixel / 360 >= 58 && pixel / 360 < 122; };
  const double error = TracedScene::psnr(truth.image, room.image, is_wall);
  printf("all directions from takes around a volume: %.2f dB\n", error);
  EXPECT_GT(error, 32);
  for (std::size_t pixel = 0; pixel < room.image.rgba.size() / 4; ++pixel) {
    if (is_wall(pixel)) {
      EXPECT_GT(room.image.rgba[4 * pixel + 3], 0.9F) << pixel % 360 << ", " << pixel / 360;
    }
  }
  EXPECT_TRUE(room.image.is_equirectangular);
}

TEST_F(Immersive, AMirrorReflectsTheWholeRoom) {
  schemas::ShotDocument::Layer ball = TracedScene::mesh("mirror", "ball.obj", {0, 0, -0.1}, 0.05);
  ball.geometry->material = schemas::ShotDocument::Material{.kind = "mirror", .color = {{1, 1, 1}}};
  schemas::ShotDocument shot = shot_looking(0);
  shot.camera.keys[0] = testing::camera_key(1, {0, 0, 0.15}, 30);
  shot.layers = walls();
  shot.layers.push_back(ball);
  const TracedScene::Picture truth = room_->render(shot);
  shot.layers = takes();
  shot.layers.push_back(ball);
  shot.lights.push_back({.light_field = "room"});
  const TracedScene::Picture by_room = room_->render(shot);
  shot.lights.back() = {.light_field = "side2"};
  const TracedScene::Picture by_one = room_->render(shot);
  // Only where it reflects rays that the takes saw: neither floor nor ceiling.
  const auto on_ball = [&](std::size_t pixel) {
    const int row = static_cast<int>(pixel / static_cast<std::size_t>(shot.width));
    return std::abs(row - shot.height / 2) < 25 && truth.front[pixel] == object_id("mirror/ball");
  };
  const double room = TracedScene::psnr(truth.image, by_room.image, on_ball);
  const double one = TracedScene::psnr(truth.image, by_one.image, on_ball);
  printf("a mirror in the volume: by all takes %.2f dB, by one %.2f dB\n", room, one);
  EXPECT_GT(room, one + 6);
}

}  // namespace
}  // namespace raystage::compose
