// SPDX-License-Identifier: Apache-2.0
// Compares equirectangular views of meshes with where their points are.
#include <OpenEXR/ImfMultiPartInputFile.h>
#include <OpenEXR/ImfStandardAttributes.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <fstream>
#include <numbers>

#include "base/error.h"
#include "compose/camera/shot_camera.h"
#include "compose/draft_shot.h"
#include "images/exr_reader.h"
#include "testing/compose/test_traced_scene.h"

namespace raystage::compose {
namespace {

using Eigen::Vector3d;
using ::testing::HasSubstr;
using Projection = schemas::ShotDocument::Camera::Projection;
using testing::TracedScene;

TEST(EquirectangularCamera, SeesLongitudeByLatitude) {
  const render::VirtualCamera camera = render::equirectangular_camera(360, 180, {});
  const auto direction = [&](double x, double y) {
    return render::pixel_ray(camera, x, y).direction;
  };
  EXPECT_LT((direction(180, 90) - Vector3d(0, 0, -1)).norm(), 1e-12);
  EXPECT_LT((direction(270, 90) - Vector3d(1, 0, 0)).norm(), 1e-12);
  EXPECT_LT((direction(0, 90) - Vector3d(0, 0, 1)).norm(), 1e-12);
  EXPECT_LT((direction(360, 90) - Vector3d(0, 0, 1)).norm(), 1e-12);
  EXPECT_LT((direction(77, 0) - Vector3d(0, 1, 0)).norm(), 1e-12);
  EXPECT_LT((direction(77, 180) - Vector3d(0, -1, 0)).norm(), 1e-12);
  const Vector3d between = direction(225, 45);
  EXPECT_LT((between - Vector3d(0.5, std::sqrt(0.5), -0.5)).norm(), 1e-12);
  EXPECT_NEAR(render::pixel_angle(camera), std::numbers::pi / 180, 1e-15);
}

TEST(EquirectangularCamera, EyesAreBesideEachColumn) {
  rig::Pose pose;
  pose.position = {1, 2, 3};
  const render::VirtualCamera left = render::equirectangular_camera(360, 180, pose, -0.03);
  const render::VirtualCamera right = render::equirectangular_camera(360, 180, pose, 0.03);
  for (const double x : {0.0, 90.0, 180.0, 255.0}) {
    for (const double y : {10.0, 90.0, 150.0}) {
      const render::WorldRay l = render::pixel_ray(left, x, y), r = render::pixel_ray(right, x, y);
      EXPECT_LT((l.direction - r.direction).norm(), 1e-12);
      EXPECT_LT(((l.origin + r.origin) / 2 - pose.position).norm(), 1e-12);
      EXPECT_NEAR((r.origin - l.origin).norm(), 0.06, 1e-12);
      EXPECT_NEAR((r.origin - l.origin).dot(r.direction), 0, 1e-12);
      EXPECT_NEAR((r.origin - l.origin).y(), 0, 1e-12);
    }
  }
  const Vector3d to_the_right =
      render::pixel_ray(right, 180, 90).origin - render::pixel_ray(left, 180, 90).origin;
  EXPECT_LT((to_the_right - Vector3d(0.06, 0, 0)).norm(), 1e-12) << "-z is ahead, +x on its right";
}

class EquirectangularShot : public ::testing::Test {
 protected:
  void SetUp() override {
    shot_.width = 240;
    shot_.height = 120;
    shot_.camera.projection = Projection::kEquirectangular;
    shot_.camera.keys = {testing::camera_key(1, {0.3, 0.2, 0.1}, 60)};
    shot_.camera.keys[0].orientation = {{std::cos(0.4), 0.1, std::sin(0.4), 0.05}};
    shot_.lights = {{.ambient = {{0.9, 0.9, 0.9}}}};
    // A ball around the camera and one in front of its wall.
    shot_.layers = {TracedScene::mesh("sky", "ball.obj", {0, 0, 0}, 6),
                    TracedScene::mesh("near", "ball.obj", {2, 0.5, -1}, 0.7)};
    for (schemas::ShotDocument::Layer& layer : shot_.layers) layer.geometry->samples = 1;
    shot_.merge = schemas::ShotDocument::Merge::kDepth;
    shot_.output.aovs = {"P"};
    shot_.output.layout = "standard";
    shot_.output.cryptomatte = true;
  }
  void expect_refused(const std::string& what) {
    try {
      scene_.render(shot_);
      ADD_FAILURE() << "not refused: " << what;
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      EXPECT_THAT(error.what(), HasSubstr(what));
    }
  }
  std::vector<float> channels(const std::string& view,
                              std::span<const images::ExrChannel> names) const {
    return view.empty()
               ? images::read_exr_channels(scene_.path("out.0001.exr"), names, "").values
               : images::ExrReader().read_view(scene_.path("out.0001.exr"), view, names, "").values;
  }
  TracedScene scene_;
  schemas::ShotDocument shot_;
};

TEST_F(EquirectangularShot, PointsAreOnTheRaysOfTheirPixelsAtTheirDepths) {
  constexpr images::ExrChannel kPoint[] = {{"P.X"}, {"P.Y"}, {"P.Z"}};
  constexpr images::ExrChannel kDepth[] = {{"Z"}};
  shot_.camera.stereo = schemas::ShotDocument::Stereo{.interaxial_m = 0.2};
  scene_.render(shot_);
  const ShotCamera shot_camera(shot_, "shot");
  for (const Eye eye : {Eye::kLeft, Eye::kRight}) {
    const std::string view = eye == Eye::kLeft ? "left" : "right";
    const std::vector<float> points = channels(view, kPoint), depths = channels(view, kDepth);
    const render::VirtualCamera camera = shot_camera.camera(1, eye);
    std::size_t near = 0;
    for (int y = 0; y < shot_.height; ++y) {
      for (int x = 0; x < shot_.width; ++x) {
        const auto pixel = static_cast<std::size_t>(y * shot_.width + x);
        const Vector3d point(double{points[3 * pixel]}, double{points[3 * pixel + 1]},
                             double{points[3 * pixel + 2]});
        const double depth = double{depths[pixel]};
        ASSERT_TRUE(std::isfinite(depth)) << "the ball is all around";
        ASSERT_LT((render::point_at_depth(camera, x + 0.5, y + 0.5, depth) - point).norm(), 1e-5)
            << x << ", " << y;
        near += depth < 3 ? 1 : 0;
      }
    }
    EXPECT_GT(near, 100U);
  }
}

TEST_F(EquirectangularShot, TheRightEyeSeesANearPointFartherLeft) {
  shot_.camera.keys[0].orientation = std::nullopt;
  shot_.camera.keys[0].target = {{2, 0.5, -1}};
  shot_.camera.stereo = schemas::ShotDocument::Stereo{.interaxial_m = 0.2};
  scene_.render(shot_);
  constexpr images::ExrChannel kDepth[] = {{"Z"}};
  const auto middle = [&](const std::string& view) {
    const std::vector<float> depths = channels(view, kDepth);
    double sum = 0, count = 0;
    for (std::size_t i = 0; i < depths.size(); ++i) {
      if (!(depths[i] < 3)) continue;
      sum += static_cast<double>(i % 240);
      ++count;
    }
    return sum / count;
  };
  const double distance = (Vector3d(2, 0.5, -1) - Vector3d(0.3, 0.2, 0.1)).norm();
  const double degrees = 2 * std::asin(0.1 / distance) * 180 / std::numbers::pi;
  // The visible half of the ball is nearer than its centre.
  EXPECT_NEAR(middle("left") - middle("right"), degrees * 240 / 360, 0.4);
}

TEST_F(EquirectangularShot, HeadersSayThatTheyShowAllDirections) {
  scene_.render(shot_);
  const Imf::MultiPartInputFile file(scene_.path("out.0001.exr").c_str());
  for (int part = 0; part < file.parts(); ++part) {
    const Imf::Header& header = file.header(part);
    ASSERT_TRUE(Imf::hasEnvmap(header));
    EXPECT_EQ(Imf::envmap(header), Imf::ENVMAP_LATLONG);
    EXPECT_EQ(header.find("worldToNDC"), header.end());
    EXPECT_NE(header.find("worldToCamera"), header.end());
  }
}

TEST_F(EquirectangularShot, WhatItCannotHaveIsRefused) {
  const schemas::ShotDocument before = shot_;
  shot_.height = 121;
  expect_refused("twice as wide as high");
  shot_ = before;
  shot_.output.overscan = {2, 0};
  expect_refused("has no surroundings");
  shot_ = before;
  shot_.camera.stereo = schemas::ShotDocument::Stereo{.interaxial_m = 0.1, .convergence_m = 4};
  expect_refused("do not converge");
  shot_ = before;
  shot_.camera.dolly_zoom = schemas::ShotDocument::DollyZoom{.target = {{0, 0, -5}}};
  expect_refused("no lens to zoom");
}

TEST_F(EquirectangularShot, TheHeadlightIsOnAllSides) {
  shot_.lights.clear();
  const ExrImage lit = scene_.render(shot_).image;
  std::size_t dark = 0;
  for (std::size_t i = 1; i < lit.rgba.size(); i += 4) dark += lit.rgba[i] < 0.02F ? 1 : 0;
  EXPECT_LT(dark, lit.rgba.size() / 4 / 20);
}

TEST_F(EquirectangularShot, ADraftStaysTwiceAsWideAsHigh) {
  shot_.width = 202;
  shot_.height = 101;
  DraftOptions options;
  options.scale = 0.25;
  const schemas::ShotDocument draft = draft_of_shot(shot_, options, "shot");
  EXPECT_EQ(draft.width, 2 * draft.height);
}

}  // namespace
}  // namespace raystage::compose
