// SPDX-License-Identifier: Apache-2.0
#include "compose/geometry/gathered_light.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <set>

#include "compose/geometry/geometry_scene.h"
#include "testing/compose/test_meshes.h"

namespace raystage::compose {
namespace {

using Eigen::Vector3d;
using Eigen::Vector3f;

constexpr int kWidth = 12, kHeight = 9;

render::VirtualCamera camera_of(int width, int height) {
  return render::virtual_camera_with_fov(width, height, 0.9, rig::Pose{});
}

/// An image of a plane at z = -4, which steps back by `step` metres right of column 5.
LayerImage stepped_plane(double step) {
  LayerImage image = transparent_layer_image(kWidth, kHeight);
  const render::VirtualCamera camera = camera_of(kWidth, kHeight);
  image.aovs = {{"P", {"X", "Y", "Z"}, false, 0, {}}, {"N", {"X", "Y", "Z"}, false, 0, {}}};
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const Vector3f point =
          render::point_at_depth(camera, x + 0.5, y + 0.5, x > 5 ? 4 + step : 4).cast<float>();
      for (const float value : point) image.aovs[0].values.push_back(value);
      image.z[static_cast<std::size_t>(y * kWidth + x)] = static_cast<float>(x > 5 ? 4 + step : 4);
      for (const float value : {0.0F, 0.0F, 1.0F}) image.aovs[1].values.push_back(value);
    }
  }
  return image;
}

TEST(GatheredLight, EverySquareHasAllParts) {
  for (int top = 0; top < 7; ++top) {
    for (int left = 0; left < 7; ++left) {
      std::set<std::uint32_t> parts;
      for (int y = top; y < top + kGatheringTile; ++y) {
        for (int x = left; x < left + kGatheringTile; ++x) parts.insert(gathering_part(x, y));
      }
      ASSERT_EQ(parts.size(), std::size_t{kGatheringTile * kGatheringTile});
      ASSERT_LT(*parts.rbegin(), std::uint32_t{kGatheringTile * kGatheringTile});
    }
  }
}

TEST(GatheredLight, OnAPlaneItIsTheMeanOfTheNeighboursTimesThePixelsOwnColour) {
  LayerImage image = stepped_plane(0);
  GatheredLight gathered(image.pixels());
  const auto radiance = [](int x, int y) {
    return static_cast<float>(std::pow(x - 4, 2) + 10 * y);
  };
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const auto at = static_cast<std::size_t>(y * kWidth + x);
      gathered.samples[at] = 2;
      gathered.radiance[at].setConstant(2 * radiance(x, y));
      gathered.color[at] = {2 * 0.5F, 0, 2 * 0.25F * static_cast<float>(x)};
      image.rgba[4 * at] = 1;  // of direct lights
    }
  }
  share_gathered_light(gathered, camera_of(kWidth, kHeight), 4, image);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      double sum = 0, count = 0;
      for (int v = std::max(0, y - 2); v <= std::min(kHeight - 1, y + 2); ++v) {
        for (int u = std::max(0, x - 2); u <= std::min(kWidth - 1, x + 2); ++u, ++count) {
          sum += double{radiance(u, v)};
        }
      }
      const auto at = static_cast<std::size_t>(4 * (y * kWidth + x));
      // Two of the four samples meet the surface.
      EXPECT_NEAR(image.rgba[at], 1 + 0.5 * 0.5 * sum / count, 1e-3) << x << " " << y;
      EXPECT_EQ(image.rgba[at + 1], 0);
      EXPECT_NEAR(image.rgba[at + 2], 0.5 * 0.25 * x * sum / count, 1e-3);
      EXPECT_EQ(image.rgba[at + 3], 0);
    }
  }
}

TEST(GatheredLight, StopsAtStepsAndEdgesAndWhereNothingIs) {
  for (const bool is_edge : {false, true}) {
    LayerImage image = stepped_plane(is_edge ? 0 : 3);
    GatheredLight gathered(image.pixels());
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const auto at = static_cast<std::size_t>(y * kWidth + x);
        if (y == 0) continue;  // no surface that gathers
        gathered.samples[at] = 1;
        gathered.radiance[at].setConstant(x > 5 ? 100.0F : 1.0F);
        gathered.color[at].setOnes();
        if (is_edge && x > 5) {
          image.aovs[1].values[3 * at] = 0.6F;
          image.aovs[1].values[3 * at + 2] = 0.8F;
        }
      }
    }
    share_gathered_light(gathered, camera_of(kWidth, kHeight), 1, image);
    for (int y = 0; y < kHeight; ++y) {
      for (int x = 0; x < kWidth; ++x) {
        const float expected = y == 0 ? 0.0F : x > 5 ? 100.0F : 1.0F;
        EXPECT_FLOAT_EQ(image.rgba[static_cast<std::size_t>(4 * (y * kWidth + x))], expected)
            << x << " " << y << " " << is_edge;
      }
    }
  }
}

TEST(GatheredLight, InfiniteLightStaysInItsPixel) {
  LayerImage image = stepped_plane(0);
  GatheredLight gathered(image.pixels());
  std::ranges::fill(gathered.samples, std::uint16_t{1});
  std::ranges::fill(gathered.radiance, Vector3f::Ones());
  std::ranges::fill(gathered.color, Vector3f::Ones());
  const std::size_t middle = 4 * kWidth + 4;
  gathered.radiance[middle].setConstant(std::numeric_limits<float>::infinity());
  share_gathered_light(gathered, camera_of(kWidth, kHeight), 1, image);
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    if (i == middle) continue;
    EXPECT_FLOAT_EQ(image.rgba[4 * i], 1);
  }
}

/// A sphere below a sky of radiance 1 receives (1 + n.y) / 2 (Lambert).
TEST(GatheredLight, OneRayPerSampleUnderAHalfSkyIsWithinTwoPercent) {
  for (const double from_origin : {0.0, 1e5}) {
    constexpr int kSamples = 9;
    const EmbreeMesh scene(testing::ball(1, testing::make_material(Material::Kind::kDiffuse), 96),
                           "ball");
    GeometryScene geometry{{testing::make_instance(scene, {from_origin, 0, -4})}, nullptr, {}};
    geometry.lights.environment_radiance = [](std::span<const render::WorldRay> rays,
                                              std::span<const float>, std::span<Vector3f> seen) {
      for (std::size_t i = 0; i < rays.size(); ++i) {
        seen[i].setConstant(rays[i].direction.y() > 0 ? 1.0F : 0.0F);
      }
    };
    geometry.lights.gather_rays = 1;
    render::VirtualCamera camera = camera_of(160, 120);
    camera.pose.position.x() = from_origin;
    const LayerImage image = render_geometry(geometry, 0, camera, kSamples);
    double squares = 0, greatest = 0;
    int pixels = 0;
    for (std::size_t i = 0; i < image.pixels(); ++i) {
      const float alpha = image.rgba[4 * i + 3];
      if (alpha < 1) continue;
      const double expected = (1 + double{image.aovs[1].values[3 * i + 1]}) / 2;
      const double error = double{image.rgba[4 * i]} - expected;
      squares += error * error;
      greatest = std::max(greatest, std::abs(error));
      ++pixels;
    }
    ASSERT_GT(pixels, 2000);
    RecordProperty("root_mean_square", std::to_string(std::sqrt(squares / pixels)));
    RecordProperty("greatest", std::to_string(greatest));
    EXPECT_LT(std::sqrt(squares / pixels), 0.015) << from_origin;
    EXPECT_LT(greatest, 0.06) << from_origin;
  }
}

}  // namespace
}  // namespace raystage::compose
