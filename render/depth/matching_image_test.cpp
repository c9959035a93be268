// SPDX-License-Identifier: Apache-2.0
// Matching images of lenses that are interpolated, compared with the lens model at every pixel.
#include "render/depth/matching_image.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <memory>

namespace raystage::render::matching_image_test {
namespace {

constexpr int kWidth = 210, kHeight = 60;

/// A frame of smooth noise.
store::DecodedFrame frame() {
  store::DecodedFrame made;
  made.width = kWidth;
  made.height = kHeight;
  made.rgba = std::make_unique<std::uint16_t[]>(4 * static_cast<std::size_t>(kWidth) * kHeight);
  for (int i = 0; i < kWidth * kHeight; ++i) {
    const int column = i % kWidth, row = i / kWidth;
    const double x = column, y = row;
    const double code = 128 + 60 * std::sin(0.9 * x + 0.3 * y) + 50 * std::cos(0.7 * y - 0.2 * x);
    for (int c = 0; c < 3; ++c) made.rgba[4 * i + c] = static_cast<std::uint16_t>(257 * code);
    made.rgba[4 * i + 3] = 65535;
  }
  return made;
}

/// Returns the luma at a position in the frame, codes.
double luma_at(const store::DecodedFrame& of, double x, double y) {
  const double u = std::clamp(x - 0.5, 0.0, kWidth - 1.0),
               v = std::clamp(y - 0.5, 0.0, kHeight - 1.0);
  const int left = static_cast<int>(u), top = static_cast<int>(v);
  const auto at = [&](int column, int row) {
    const int i = std::min(row, kHeight - 1) * kWidth + std::min(column, kWidth - 1);
    return std::floor(255 * (of.rgba[4 * i] >> 4U) / 4095.0 + 0.5);
  };
  const double right = u - left, down = v - top;
  return (1 - down) * ((1 - right) * at(left, top) + right * at(left + 1, top)) +
         down * ((1 - right) * at(left, top + 1) + right * at(left + 1, top + 1));
}

TEST(MatchingImages, OfInterpolatedLensesAreThoseOfTheirModels) {
  const store::DecodedFrame pixels = frame();
  for (const schemas::Distortion& lens :
       {schemas::Distortion{-2, 5, 0.01, -0.02, 0}, schemas::Distortion{0.9, -3, 0, 0.01, 1},
        // Not valid in the corners.
        schemas::Distortion{-9, 0, 0, 0, 0}}) {
    const schemas::CameraGeometry geometry{"c", kWidth, kHeight, {420, 415, 101, 33, lens},
                                           {},  {},     {}};
    const rig::Rig::Camera camera{"c", rig::CameraModel(geometry), {}, {}, {}, {}};
    const VirtualCamera pinhole = undistorted(camera.model, camera.pose);
    const MatchingImage image(pixels, {store::BlendSpace::kPerceptual, 1}, camera, pinhole);
    const schemas::Intrinsics& k = pinhole.intrinsics;
    int all = 0, differ = 0, shown_differs = 0;
    double moved = 0;
    for (int y = 0; y + 1 < pinhole.height; ++y) {
      for (int x = 0; x + 1 < pinhole.width; ++x) {
        const auto exact = [&](int column, int row) {
          const auto at = camera.model.pixel_from_ideal(
              {(column + 0.5 - k.cx) / k.fx, (row + 0.5 - k.cy) / k.fy});
          const bool is_shown =
              at && at->x() >= 0 && at->y() >= 0 && at->x() <= kWidth && at->y() <= kHeight;
          return is_shown ? at : std::nullopt;
        };
        const auto at = exact(x, y);
        const bool is_known = at && exact(x + 1, y) && exact(x, y + 1) && exact(x + 1, y + 1);
        shown_differs += is_known != image.is_known(x, y) ? 1 : 0;
        if (!is_known || !image.is_known(x, y)) continue;
        ++all;
        moved = std::max(moved, std::abs(at->x() - x - 0.5 - k.cx + geometry.intrinsics.cx));
        const double expected = std::floor(luma_at(pixels, at->x(), at->y()) + 0.5);
        ASSERT_LE(std::abs(image.luma(x, y) - expected), 1) << x << ", " << y;
        differ += image.luma(x, y) != expected ? 1 : 0;
      }
    }
    EXPECT_GT(all, kWidth * kHeight / 2);
    EXPECT_GT(moved, 1) << "the lens distorts";
    EXPECT_LT(differ, all / 200);
    EXPECT_LE(shown_differs, 4);
  }
}

}  // namespace
}  // namespace raystage::render::matching_image_test
