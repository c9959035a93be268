// SPDX-License-Identifier: Apache-2.0
// Compares a scene of geometry with one whose back half is replaced by its light field.
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

/// Shared by all tests: a take of the half that becomes a light field.
class GeometryTruth : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    scene_ = std::make_unique<TracedScene>();
    schemas::ShotDocument seen = shot_from({0, 0, 0}, 56, 320, 240);
    seen.layers = set();
    for (schemas::ShotDocument::Layer& layer : seen.layers) layer.geometry->samples = 4;
    scene_->write_take("take", seen, {});
  }
  static void TearDownTestSuite() { scene_.reset(); }

  static std::filesystem::path path(const std::string& name) { return scene_->path(name); }
  static TracedScene::Picture render(const schemas::ShotDocument& shot) {
    return scene_->render(shot);
  }

  /// Returns the meshes that become the light field, and those that stay geometry.
  static std::vector<schemas::ShotDocument::Layer> set() {
    return {TracedScene::mesh("backdrop", "plane.obj", {0, 0, -6}, 6),
            TracedScene::mesh("left", "ball.obj", {-0.7, 0.1, -3.6}, 0.5)};
  }
  static std::vector<schemas::ShotDocument::Layer> props() {
    return {TracedScene::mesh("right", "ball.obj", {0.45, -0.1, -3.2}, 0.45),
            TracedScene::mesh("behind", "ball.obj", {-0.35, 0.35, -4.3}, 0.5)};
  }

  static schemas::ShotDocument shot_from(const std::array<double, 3>& eye, double fov, int width,
                                         int height) {
    schemas::ShotDocument shot;
    shot.width = width;
    shot.height = height;
    shot.merge = schemas::ShotDocument::Merge::kDepth;
    shot.camera.keys = {testing::camera_key(1, {eye[0], eye[1], eye[2]}, fov)};
    shot.lights = {{.ambient = {{0.5, 0.5, 0.5}}},
                   {.direction = {{-0.3, -0.6, -0.7}}, .color = {0.4, 0.4, 0.4}, .shadows = false}};
    shot.output.cryptomatte = true;
    return shot;
  }

  static schemas::ShotDocument::Layer light_field() {
    schemas::ShotDocument::Layer layer;
    layer.name = "set";
    layer.take = "take";
    layer.method = "depth";
    return layer;
  }

  static std::unique_ptr<TracedScene> scene_;
};

std::unique_ptr<TracedScene> GeometryTruth::scene_;

TEST_F(GeometryTruth, HalfOfItAsALightFieldLooksTheSame) {
  schemas::ShotDocument shot = shot_from({0.05, 0.03, -0.1}, 44, 240, 180);
  shot.layers = set();
  for (const auto& layer : props()) shot.layers.push_back(layer);
  const TracedScene::Picture truth = render(shot);
  shot.layers = props();
  shot.layers.insert(shot.layers.begin(), light_field());
  const TracedScene::Picture mixed = render(shot);
  const double error =
      TracedScene::psnr(truth.image, mixed.image, [](std::size_t) { return true; });
  std::size_t wrong = 0, shown = 0;
  for (const char* prop : {"right/ball", "behind/ball"}) {
    const float id = object_id(prop);
    for (std::size_t i = 0; i < truth.front.size(); ++i) {
      wrong += (truth.front[i] == id) != (mixed.front[i] == id);
      shown += truth.front[i] == id;
    }
  }
  const double share = static_cast<double>(wrong) / static_cast<double>(truth.front.size());
  printf("light field and geometry against all traced: %.2f dB, order wrong in %.3f %% of pixels\n",
         error, 100 * share);
  EXPECT_GT(shown, 3000U);
  EXPECT_GT(error, 35);
  EXPECT_LT(share, 0.005);
}

TEST_F(GeometryTruth, ReflectionsByLightFieldAreNearerThanByEnvironmentMap) {
  // The floor is a mirror that reflects the backdrop and the left ball.
  schemas::ShotDocument::Layer floor = TracedScene::mesh("floor", "plane.obj", {0, -0.75, -3.6}, 2);
  floor.geometry->material =
      schemas::ShotDocument::Material{.kind = "mirror", .color = {{0.9, 0.9, 0.9}}};
  const double half = std::sqrt(0.5);
  floor.geometry->keys[0].orientation = {{half, -half, 0, 0}};  // faces up
  schemas::ShotDocument shot = shot_from({0.05, 0.03, -0.1}, 44, 240, 180);
  shot.output.cryptomatte = true;
  shot.layers = set();
  shot.layers.push_back(floor);
  const TracedScene::Picture truth = render(shot);

  // An environment map as the centre camera sees it, grey outside its view.
  schemas::ShotDocument around = shot_from({0, 0, 0}, 120, 512, 512);
  around.layers = set();
  const ExrImage view = render(around).image;
  constexpr int kWidth = 1024, kHeight = 512;
  std::ofstream map(path("around.ppm"), std::ios::binary);
  map << "P6 " << kWidth << ' ' << kHeight << " 255\n";
  const double focal = 256 / std::tan(std::numbers::pi / 3);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const double longitude = 2 * std::numbers::pi * ((x + 0.5) / kWidth - 0.5);
      const double latitude = std::numbers::pi * (0.5 - (y + 0.5) / kHeight);
      const double ahead = std::cos(latitude) * std::cos(longitude);
      const int px =
          static_cast<int>(256 + focal * std::cos(latitude) * std::sin(longitude) / ahead);
      const int py = static_cast<int>(256 - focal * std::sin(latitude) / ahead);
      const bool is_seen = ahead > 0.1 && px >= 0 && px < 512 && py >= 0 && py < 512;
      for (std::size_t c = 0; c < 3; ++c) {
        const double value =
            is_seen ? double{view.rgba[4 * static_cast<std::size_t>(py * 512 + px) + c]} : 0.2;
        map.put(static_cast<char>(std::lround(255 * srgb_from_linear(std::min(value, 1.0)))));
      }
    }
  }
  map.close();

  schemas::ShotDocument mirrored = shot;
  mirrored.layers = {light_field(), floor};
  mirrored.lights.push_back({.light_field = "set"});
  const TracedScene::Picture by_light_field = render(mirrored);
  mirrored.lights.back() = {.environment = "around.ppm"};
  const TracedScene::Picture by_map = render(mirrored);
  const auto on_floor = [&](std::size_t pixel) {
    return truth.front[pixel] == object_id("floor/plane");
  };
  const double field = TracedScene::psnr(truth.image, by_light_field.image, on_floor);
  const double environment = TracedScene::psnr(truth.image, by_map.image, on_floor);
  printf("reflection against traced: by light field %.2f dB, by environment map %.2f dB\n", field,
         environment);
  EXPECT_GT(field, environment + 6);
}

}  // namespace
}  // namespace raystage::compose
