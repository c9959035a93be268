// SPDX-License-Identifier: Apache-2.0
#include "render/planar/object_planes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <random>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/transfer_function.h"
#include "render/common/ray_cells.h"
#include "render/methods.h"
#include "render/renderer.h"
#include "testing/render/synthetic_take.h"

namespace raystage::render::object_planes_test {
namespace {

using Eigen::Vector3d;
using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double kDegree = std::numbers::pi / 180;

schemas::PlanesDocument::Plane card(double left, double right, double bottom, double top,
                                    double depth) {
  return {
      "card",
      {{left, bottom, -depth}, {right, bottom, -depth}, {right, top, -depth}, {left, top, -depth}}};
}

std::vector<ObjectPlane> objects_of(std::vector<schemas::PlanesDocument::Plane> planes) {
  return make_object_planes({std::move(planes)}, "planes.json");
}

std::string refusal(const schemas::PlanesDocument::Plane& plane) {
  try {
    objects_of({card(0, 1, 0, 1, 3), plane});
  } catch (const Error& error) {
    return error.what();
  }
  return "accepted";
}

TEST(ObjectPlanes, WhatIsNoFlatConvexPolygonIsRefused) {
  schemas::PlanesDocument::Plane bent = card(0, 1, 0, 1, 3);
  bent.corners[2][2] = -3.3;
  EXPECT_THAT(refusal(bent), HasSubstr("m from the plane"));
  EXPECT_THAT(refusal(bent), HasSubstr("planes.json#/planes/1/corners"));
  bent.corners[2][2] = -3.001;  // set manually
  EXPECT_EQ(refusal(bent), "accepted");
  EXPECT_THAT(refusal({"line", {{0, 0, 0}, {1, 1, 1}, {2, 2, 2}}}), HasSubstr("no area"));
  EXPECT_THAT(refusal({"point", {{1, 1, 1}, {1, 1, 1}, {1, 1, 1}}}), HasSubstr("no area"));
  EXPECT_THAT(refusal({"arrow", {{0, 0, 0}, {2, 1, 0}, {0, 2, 0}, {1, 1, 0}}}),
              HasSubstr("not convex"));
  schemas::PlanesDocument::Plane star{"star", {}};
  for (int i = 0; i < 5; ++i) {
    star.corners.push_back({std::cos(i * 144 * kDegree), std::sin(i * 144 * kDegree), 0});
  }
  EXPECT_THAT(refusal(star), HasSubstr("not convex"));
}

TEST(ObjectPlanes, RegionsAreWhatRaysMeetFirst) {
  std::mt19937 random(20051);
  std::uniform_real_distribution<double> any(-1, 1);
  int met = 0;
  for (int round = 0; round < 40; ++round) {
    // Polygons on circles anywhere around the view, including behind it and across its plane.
    const double scale = std::pow(10, 6 * any(random));
    std::vector<schemas::PlanesDocument::Plane> planes;
    for (int i = 0; i < 5; ++i) {
      const Eigen::Quaterniond turn =
          Eigen::Quaterniond(any(random), any(random), any(random), any(random)).normalized();
      const Vector3d middle(2 * any(random), 2 * any(random), 3 * any(random));
      schemas::PlanesDocument::Plane plane{"p" + std::to_string(i), {}};
      for (int corner = 0; corner < 3 + i; ++corner) {
        const double angle = 2 * std::numbers::pi * corner / (3 + i) * (round % 2 == 0 ? 1 : -1);
        const Vector3d at =
            scale * (middle + turn * Vector3d(1.5 * std::cos(angle), std::sin(angle), 0));
        plane.corners.push_back({at.x(), at.y(), at.z()});
      }
      planes.push_back(plane);
    }
    const std::vector<ObjectPlane> objects = objects_of(planes);
    rig::Pose pose;
    pose.position = scale * Vector3d(any(random), any(random), any(random));
    const VirtualCamera view =
        virtual_camera_with_fov(48, 32, (round % 3 == 0 ? 150 : 60) * kDegree, pose);
    const std::vector<ViewRegion> regions = object_regions(view, objects);
    ASSERT_EQ(regions.size(), 6U);
    const Eigen::Matrix3d ray_from_pixel = world_ray_from_pixel(view);
    int differ = 0;
    for (int y = 0; y < view.height; ++y) {
      std::vector<std::size_t> owner(48, 99);
      int pixels = 0;
      for (std::size_t i = 0; i < regions.size(); ++i) {
        for (const PixelInterval& interval : regions[i][y]) {
          for (int x = interval.begin; x < interval.end; ++x, ++pixels) {
            owner[x] = i;
          }
        }
      }
      ASSERT_EQ(pixels, 48);  // each once
      for (int x = 0; x < view.width; ++x) {
        const Vector3d ray = ray_from_pixel * Vector3d(x + 0.5, y + 0.5, 1);
        std::size_t first = objects.size();
        double nearest = std::numeric_limits<double>::infinity();
        for (std::size_t i = 0; i < objects.size(); ++i) {
          const auto along = intersect_ray(objects[i], pose.position, ray);
          if (!along || *along >= nearest) continue;
          nearest = *along;
          first = i;
        }
        differ += owner[x] != first ? 1 : 0;
        met += first < objects.size() ? 1 : 0;
      }
    }
    EXPECT_LE(differ, 1) << "round " << round;  // a ray that meets an edge
  }
  EXPECT_GT(met, 10000);
}

TEST(ObjectPlanes, AnEyeInItsPlaneMeetsNone) {
  rig::Pose pose;
  pose.position = {0, 0, -3};
  const VirtualCamera view = virtual_camera_with_fov(16, 8, 60 * kDegree, pose);
  const auto objects = objects_of({card(-1, 1, -1, 1, 3)});
  const auto regions = object_regions(view, objects);
  for (int y = 0; y < view.height; ++y) {
    EXPECT_TRUE(regions[0][y].empty());
    EXPECT_THAT(regions[1][y], ElementsAre(PixelInterval{0, 16}));
  }
}

/// A card 2 m away in front of a wall 6 m away, both striped.
class CardBeforeWall : public ::testing::Test {
 protected:
  void SetUp() override {
    testing::SyntheticTake settings;
    settings.cameras = testing::camera_grid(4, 4, 0.06, 160, 120);
    settings.scene = [](const Vector3d& origin, const Vector3d& direction) {
      return seen(origin, direction);
    };
    settings.depth_range = schemas::DepthRange{2, 6};
    settings.jpeg.chroma = store::JpegEncodeOptions::Chroma::k444;
    write_synthetic_take(settings, folder_.path() / "take");
    take_.emplace(folder_.path() / "take");
    write_file_atomically(folder_.path() / "take" / "planes.json",
                          schemas::format_planes({{card(-0.35, 0.3, -0.4, 0.25, 2)}}));
  }

  static std::array<double, 3> seen(const Vector3d& origin, const Vector3d& direction) {
    const Vector3d near = origin + direction * ((-2 - origin.z()) / direction.z());
    const bool on_card = near.x() > -0.35 && near.x() < 0.3 && near.y() > -0.4 && near.y() < 0.25;
    const Vector3d at =
        on_card ? near : Vector3d(origin + direction * ((-6 - origin.z()) / direction.z()));
    const double wave = std::sin(at.x() * (on_card ? 40 : 6)) * std::cos(at.y() * 10);
    return {0.3 + 0.2 * wave, on_card ? 0.6 : 0.2, 0.3 - 0.2 * wave};
  }

  RenderedView render(const VirtualCamera& view, const schemas::OptionValues& options,
                      bool reference, const std::string& method = "focal_plane") const {
    RendererOptions settings;
    settings.reference = reference;
    settings.count_needed_pixels = true;
    return LightFieldRenderer(*take_, settings)
        .render(view, store::select_frames(*take_, 0, 1'000'000),
                {method, rig::fronto_parallel_plane(take_->rig(), 6), options});
  }

  /// Returns the root mean square error against the truth, in sRGB codes over covered pixels. The
  /// card's edges are excluded, because cameras see past it.
  static double error_of(const RenderedView& image, const VirtualCamera& view) {
    const Eigen::Matrix3d ray_from_pixel = world_ray_from_pixel(view);
    double squares = 0, count = 0;
    for (int y = 0; y < view.height; ++y) {
      for (int x = 0; x < view.width; ++x) {
        const auto at = static_cast<std::size_t>(y * view.width + x);
        if (image.rgba[4 * at + 3] < 0.999F) continue;
        const Vector3d& eye = view.pose.position;
        const Vector3d ray = ray_from_pixel * Vector3d(x + 0.5, y + 0.5, 1);
        const Vector3d near = eye + ray * ((-2 - eye.z()) / ray.z());
        const double beside =
            std::max({near.x() - 0.3, -0.35 - near.x(), near.y() - 0.25, -0.4 - near.y()});
        if (std::abs(beside) < 0.1) continue;
        const auto truth = seen(eye, ray);
        for (std::size_t c = 0; c < 3; ++c) {
          const double off = 255 * (srgb_from_linear(static_cast<double>(image.rgba[4 * at + c])) -
                                    srgb_from_linear(truth[c]));
          squares += off * off;
          ++count;
        }
      }
    }
    return std::sqrt(squares / count);
  }

  testing::TestFolder folder_;
  std::optional<store::Take> take_;
};

VirtualCamera between_cameras() {
  rig::Pose pose;
  pose.position = {0.013, -0.017, 0.02};
  return virtual_camera_with_fov(140, 100, 45 * kDegree, pose);
}

TEST_F(CardBeforeWall, IsSharpOnBothPlanesOfItsOwn) {
  const VirtualCamera view = between_cameras();
  const double with_card =
      error_of(render(view, {{"objects", std::string("planes.json")}}, false), view);
  const double wall_alone = error_of(render(view, {}, false), view);
  EXPECT_LT(with_card, 0.5 * wall_alone) << with_card << " against " << wall_alone;
}

TEST_F(CardBeforeWall, AgreesWithTheReference) {
  const schemas::OptionValues options{{"objects", std::string("planes.json")}};
  VirtualCamera turned = between_cameras();
  turned.pose.position = {0.1, 0.05, 0.3};
  turned.pose.world_from_camera_rotation =
      Eigen::AngleAxisd(9 * kDegree, Vector3d(0.2, 1, 0.5).normalized()).toRotationMatrix();
  for (const char* method : {"focal_plane", "nearest"}) {
    for (const VirtualCamera& view : {between_cameras(), turned}) {
      const RenderedView fast = render(view, options, false, method);
      const RenderedView slow = render(view, options, true, method);
      std::size_t differ = 0, near = 0;
      for (std::size_t i = 0; i < fast.z.size(); ++i) {
        double worst = std::abs(static_cast<double>(fast.coverage[i] - slow.coverage[i]));
        for (std::size_t c = 4 * i; c < 4 * i + 4; ++c) {
          worst = std::max(worst, std::abs(static_cast<double>(fast.rgba[c] - slow.rgba[c])));
        }
        if (std::isfinite(slow.z[i])) {
          worst = std::max(worst, std::abs(static_cast<double>(fast.z[i] / slow.z[i] - 1)));
        }
        differ += worst > 1e-3 ? 1 : 0;
        near += slow.z[i] < 3 ? 1 : 0;
      }
      // A border between cells, or an edge of the card, may pass through a pixel's centre.
      EXPECT_LE(differ, 2U) << method;
      EXPECT_GT(near, 500U);
      EXPECT_GT(fast.statistics.pixels_needed, 1000);
      EXPECT_EQ(fast.statistics.working_bytes, view_buffer_bytes(view));  // of one object at a time
    }
  }
}

TEST_F(CardBeforeWall, IsPartOfTheFingerprint) {
  const Method& method = method_named("focal_plane");
  const store::FrameSelection frames = store::select_frames(*take_, 0, 1'000'000);
  EXPECT_TRUE(method.input_files(MethodOptions(method.options(), {}, "focal_plane"), *take_, frames)
                  .empty());
  EXPECT_THAT(
      method.input_files(
          MethodOptions(method.options(), {{"objects", std::string("planes.json")}}, "focal_plane"),
          *take_, frames),
      ElementsAre(take_->folder() / "planes.json"));
  EXPECT_THROW(render(between_cameras(), {{"objects", std::string("none.json")}}, false), Error);
}

}  // namespace
}  // namespace raystage::render::object_planes_test
