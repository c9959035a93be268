// SPDX-License-Identifier: Apache-2.0
// Tests of views with less and with more resolution than the light field.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <numbers>

#include "render/methods.h"
#include "render/renderer.h"
#include "testing/render/synthetic_take.h"

namespace raystage::render::supersampling_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

constexpr double kDegree = std::numbers::pi / 180;
constexpr double kMean = 0.4, kAmplitude = 0.3;
const Eigen::Vector4d kPlane(0, 0, 1, 4);

/// Cameras of 160x120 that see stripes on the plane, each four of their pixels wide.
class Filtering : public ::testing::Test {
 protected:
  Filtering() {
    testing::SyntheticTake settings;
    settings.cameras = testing::camera_grid(3, 3, 0.06, 160, 120);
    settings.jpeg.quality = 98;
    const double pixel = 4 * 2 * std::tan(31 * kDegree) / 160;  // metres on the plane
    settings.scene = [pixel](const Eigen::Vector3d& origin, const Eigen::Vector3d& direction) {
      const double x = origin.x() + direction.x() * (-4 - origin.z()) / direction.z();
      const double stripes = kMean + kAmplitude * std::sin(2 * std::numbers::pi * x / (4 * pixel));
      return std::array{stripes, stripes, stripes};
    };
    write_synthetic_take(settings, folder_.path() / "take");
    take_ = std::make_unique<store::Take>(folder_.path() / "take");
  }

  static VirtualCamera view_of(int width) {
    rig::Pose pose;
    pose.position = {0.013, 0.01, 0};
    return virtual_camera_with_fov(width, width * 3 / 4, 50 * kDegree, pose);
  }

  RenderedView render(int width, const std::string& method, const RendererOptions& settings = {},
                      const schemas::OptionValues& options = {}) const {
    return LightFieldRenderer(*take_, settings)
        .render(view_of(width), store::select_frames(*take_, 0, 1), {method, kPlane, options});
  }

  /// Returns the root mean square of the difference from the stripes' mean: their remaining
  /// contrast.
  static double contrast(const RenderedView& image) {
    double sum = 0;
    for (std::size_t i = 0; i < image.coverage.size(); ++i) {
      EXPECT_GT(image.rgba[i * 4 + 3], 0.999F);
      sum += std::pow(static_cast<double>(image.rgba[i * 4]) - kMean, 2);
    }
    return std::sqrt(sum / static_cast<double>(image.coverage.size()));
  }

  testing::TestFolder folder_;
  std::unique_ptr<store::Take> take_;
};

TEST_F(Filtering, CoarseViewsAverageInsteadOfAliasing) {
  RendererOptions never;
  never.max_supersampling = 1;
  for (const std::string method : {"focal_plane", "slabs"}) {
    SCOPED_TRACE(method);
    // Each pixel covers six camera pixels, one and a half stripes: it is the stripes' mean and
    // sin(x) / x of their contrast.
    const int width =
        static_cast<int>(std::round(160 * std::tan(25 * kDegree) / std::tan(31 * kDegree) / 6));
    const RenderedView filtered = render(width, method), aliased = render(width, method, never);
    const double footprint = filtered.statistics.source_pixels_per_pixel;
    EXPECT_NEAR(footprint, 6, 0.3);
    EXPECT_EQ(filtered.statistics.supersampling, 6);
    EXPECT_EQ(aliased.statistics.supersampling, 1);
    const double angle = std::numbers::pi * footprint / 4;
    const double expected = kAmplitude / std::numbers::sqrt2 * std::abs(std::sin(angle) / angle);
    EXPECT_GT(contrast(aliased), 0.7 * kAmplitude / std::numbers::sqrt2);
    EXPECT_LT(contrast(filtered), 1.15 * expected);
    EXPECT_GT(filtered.rgba.size(), 0U);
    EXPECT_EQ(filtered.width, width);
    EXPECT_EQ(filtered.z.size(), filtered.coverage.size());
    EXPECT_NEAR(filtered.z[0], 4, 1e-4);
    EXPECT_TRUE(filtered.notes.empty());
  }
}

TEST_F(Filtering, FineViewsAreLeftAsTheyAreAndSaySo) {
  RendererOptions never;
  never.max_supersampling = 1;
  for (const int width : {124, 160, 400}) {
    const RenderedView image = render(width, "focal_plane");
    EXPECT_LE(image.statistics.source_pixels_per_pixel, 1.01);
    EXPECT_EQ(image.statistics.supersampling, 1);
    EXPECT_EQ(image.rgba, render(width, "focal_plane", never).rgba);
    EXPECT_EQ(image.notes.size(), width == 400 ? 1U : 0U);
    if (width == 400) {  // 3.2 times
      EXPECT_THAT(image.notes[0], HasSubstr("at least 3 pixels"));
    }
  }
}

TEST_F(Filtering, MemoryBoundsTheFactor) {
  RendererOptions little;
  little.supersampling_bytes = 20 * 15 * 24 * 4;  // twice as many pixels along each axis
  const RenderedView image = render(20, "depth", little);
  EXPECT_NEAR(image.statistics.source_pixels_per_pixel, 6, 0.5);
  EXPECT_EQ(image.statistics.supersampling, 2);
  EXPECT_THAT(image.notes, ElementsAre(HasSubstr("2 samples per pixel and axis")));
  // Working memory must not change the pixels.
  RendererOptions no_room;
  no_room.working_bytes = 0;
  EXPECT_EQ(render(20, "focal_plane", no_room).rgba, render(20, "focal_plane").rgba);
}

TEST_F(Filtering, SaysWhereMoreSamplesAreCalledFor) {
  // Pixels of 12 camera pixels: more samples than the maximum.
  const RenderedView image = render(10, "focal_plane");
  EXPECT_GT(image.statistics.source_pixels_per_pixel, 10);
  EXPECT_EQ(image.statistics.supersampling, 8);
  EXPECT_THAT(image.notes, ElementsAre(HasSubstr("8 samples per pixel and axis")));
  RendererOptions never;
  never.max_supersampling = 1;
  EXPECT_THAT(render(10, "slabs", never).notes,
              ElementsAre(HasSubstr("1 sample per pixel and axis")));
}

TEST_F(Filtering, PreviewsMayAliasAndSaySo) {
  RendererOptions never;
  never.max_supersampling = 1;
  const VirtualCamera view = view_of(20);
  ReconstructionOptions preview{"focal_plane", kPlane};
  preview.max_supersampling = 1;
  const store::FrameSelection frames = store::select_frames(*take_, 0, 1);
  const LightFieldRenderer renderer(*take_, {});
  const RenderedView image = renderer.render(view, frames, preview);
  EXPECT_EQ(image.statistics.supersampling, 1);
  EXPECT_EQ(image.rgba, render(20, "focal_plane", never).rgba);
  EXPECT_THAT(image.notes, ElementsAre(HasSubstr("1 sample per pixel and axis")));
  EXPECT_LT(renderer.view_bytes(view, frames, preview),
            renderer.view_bytes(view, frames, {"focal_plane", kPlane}));
}

TEST_F(Filtering, MemoryOfAViewIsWhatItsValuesTake) {
  const auto bytes = [&](int width, const std::string& method, bool measure_coverage) {
    RendererOptions settings;
    settings.measure_coverage = measure_coverage;
    return LightFieldRenderer(*take_, settings)
        .view_bytes(view_of(width), store::select_frames(*take_, 0, 1), {method, kPlane});
  };
  constexpr std::size_t kFine = 160 * 120, kCoarse = 20 * 15, kSamples = 6 * 6;
  const auto factor = static_cast<std::size_t>(render(20, "focal_plane").statistics.supersampling);
  ASSERT_EQ(factor * factor, kSamples);
  // Floats per pixel: RGBA, coverage, depth; cameras and nearest_ray; empty space.
  EXPECT_EQ(bytes(160, "focal_plane", false), kFine * 6 * 4);
  EXPECT_EQ(bytes(160, "focal_plane", true), kFine * 8 * 4);
  EXPECT_EQ(bytes(160, "visual_hull", false), kFine * 7 * 4);
  EXPECT_EQ(bytes(160, "visual_hull", true), kFine * 9 * 4);
  EXPECT_EQ(bytes(20, "focal_plane", false), kCoarse * (kSamples + 1) * 6 * 4);
  EXPECT_EQ(bytes(20, "focal_plane", true), kCoarse * (kSamples + 1) * 8 * 4);
}

TEST_F(Filtering, WhatIsMeasuredBesideDoesNotChangeThePixels) {
  RendererOptions little;
  little.supersampling_bytes = 20 * 15 * 24 * 9;
  RendererOptions measured = little;
  measured.measure_coverage = true;
  for (const std::string method : {"focal_plane", "depth"}) {
    const RenderedView image = render(20, method, little);
    EXPECT_EQ(image.statistics.supersampling, method == "depth" ? 3 : 6);
    EXPECT_EQ(render(20, method, measured).rgba, image.rgba);
  }
}

}  // namespace
}  // namespace raystage::render::supersampling_test
