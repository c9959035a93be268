// SPDX-License-Identifier: Apache-2.0
// Tests of the agreement of the cameras around a ray with the view (measure_confidence()).
#include "render/confidence.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "render/methods.h"
#include "render/renderer.h"
#include "testing/render/synthetic_take.h"

namespace raystage::render {
namespace {

using Eigen::Vector3d;

/// Returns the light of a striped wall 4 m away and, in front of it at 2 m, a red square of 20 cm.
std::array<double, 3> wall_and_square(const Vector3d& origin, const Vector3d& direction) {
  const Vector3d near = origin + direction * ((-2 - origin.z()) / direction.z());
  if (std::abs(near.x()) < 0.1 && std::abs(near.y()) < 0.1) return {0.8, 0.05, 0.05};
  const Vector3d far = origin + direction * ((-4 - origin.z()) / direction.z());
  return {0.4 + 0.3 * std::sin(12 * far.x()), 0.4 + 0.3 * std::sin(15 * far.y()), 0.3};
}

class Confidence : public ::testing::Test {
 protected:
  static constexpr int kWidth = 120, kHeight = 90;

  void SetUp() override {
    testing::SyntheticTake options;
    options.cameras = testing::camera_grid(3, 3, 0.1, 320, 240, {-0.1, 0.02, 0, 0, 0});
    options.scene = wall_and_square;
    options.depth_range = schemas::DepthRange{1.8, 4.5};
    options.samples = 2;
    options.absent = {{8, 0}};
    write_synthetic_take(options, folder_.path() / "take");
  }
  RenderedView render(const std::string& method, double plane, bool reference = false,
                      const schemas::Distortion& distortion = {}, int width = kWidth) const {
    const store::Take take(folder_.path() / "take");
    VirtualCamera view =
        virtual_camera_with_fov(width, width * 3 / 4, 0.8, {Eigen::Matrix3d::Identity(), kEye});
    view.intrinsics.distortion = distortion;
    RendererOptions options;
    options.measure_confidence = true;
    options.reference = reference;
    return LightFieldRenderer(take, options)
        .render(view, store::select_frames(take, 0, 1), {method, {0, 0, 1, plane}, {}});
  }
  static float mean(const RenderedView& image, int left, int right, int top, int bottom) {
    float sum = 0;
    for (int y = top; y < bottom; ++y) {
      for (int x = left; x < right; ++x) {
        sum += image.confidence[y * image.width + x];
      }
    }
    return sum / static_cast<float>((right - left) * (bottom - top));
  }
  static inline const Vector3d kEye{0.03, 0.02, 0};
  testing::TestFolder folder_;
};

TEST_F(Confidence, IsHighWhereThePlaneIsRightAndLowWhereItIsNot) {
  const RenderedView wall = render("focal_plane", 4), square = render("focal_plane", 2);
  EXPECT_GT(mean(wall, 5, 35, 10, 80), 0.9F);
  EXPECT_LT(mean(square, 5, 35, 10, 80), 0.5F);
  // The square's edges are doubled on the wall's plane, and sharp on the square's own plane.
  const auto least = [](const RenderedView& image) {
    float found = 1;
    for (int x = 40; x < 80; ++x) {
      found = std::min(found, image.confidence[45 * kWidth + x]);
    }
    return found;
  };
  EXPECT_LT(least(wall), 0.4F);
  EXPECT_GT(mean(square, 56, 62, 43, 47), 0.9F);
}

TEST_F(Confidence, IsHighOnBothWhereDepthIsFound) {
  const RenderedView image = render("depth", 4);
  EXPECT_GT(mean(image, 5, 35, 10, 80), 0.85F);
  EXPECT_GT(mean(image, 56, 62, 43, 47), 0.85F);
}

TEST_F(Confidence, AgreesWithTheReferenceForEveryMethod) {
  for (const char* method :
       {"focal_plane", "nearest", "aperture", "lumigraph", "slabs", "plane_sweep"}) {
    const RenderedView fast = render(method, 3.5), slow = render(method, 3.5, true);
    ASSERT_EQ(fast.confidence.size(), slow.confidence.size()) << method;
    double sum = 0;
    std::size_t differ = 0;
    for (std::size_t i = 0; i < fast.confidence.size(); ++i) {
      sum += double{slow.confidence[i]};
      differ += std::abs(fast.confidence[i] - slow.confidence[i]) > 0.02F ? 1 : 0;
      EXPECT_GE(fast.confidence[i], 0);
      EXPECT_LE(fast.confidence[i], 1.0001F);
      EXPECT_TRUE(fast.rgba[4 * i + 3] > 0 || fast.confidence[i] == 0);
    }
    // The views of the two implementations differ as much at some pixels.
    EXPECT_LE(differ, fast.confidence.size() / 100) << method;
    EXPECT_GT(sum, 0.2 * static_cast<double>(slow.confidence.size())) << method;
  }
}

TEST_F(Confidence, IsToldOfLensesThatDistortAndOfCoarseViews) {
  const RenderedView bent = render("focal_plane", 4, false, {-0.1, 0, 0, 0, 0});
  EXPECT_GT(mean(bent, 5, 35, 10, 80), 0.9F);
  const RenderedView coarse = render("focal_plane", 4, false, {}, 40);
  ASSERT_EQ(coarse.confidence.size(), coarse.coverage.size());
  EXPECT_GT(coarse.statistics.supersampling, 1);
  EXPECT_GT(mean(coarse, 2, 12, 4, 26), 0.9F);
}

TEST_F(Confidence, IsNoneWhereThereIsNothing) {
  const store::Take take(folder_.path() / "take");
  RendererOptions options;
  options.measure_confidence = true;
  const VirtualCamera view =
      virtual_camera_with_fov(kWidth, kHeight, 0.8, {Eigen::Matrix3d::Identity(), kEye});
  store::FrameSelection nothing = store::select_frames(take, 0, 1);
  std::ranges::fill(nothing.frame, -1);
  const RenderedView image =
      LightFieldRenderer(take, options).render(view, nothing, {"focal_plane", {0, 0, 1, 4}, {}});
  ASSERT_EQ(image.confidence.size(), image.coverage.size());
  EXPECT_EQ(std::ranges::count(image.confidence, 0.0F),
            static_cast<std::ptrdiff_t>(image.confidence.size()));
}

}  // namespace
}  // namespace raystage::render
