// SPDX-License-Identifier: Apache-2.0
#include "render/hull/matte.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>

namespace raystage::render {
namespace {

/// Returns the radius along both axes within which all pixels have the pixel's value.
int alike_around(const Matte::Raster& raster, int x, int y) {
  const auto value = [&](int u, int v) { return raster.values[v * raster.width + u]; };
  for (int far = 0; far < 254; ++far) {
    for (int v = std::max(y - far - 1, 0); v <= std::min(y + far + 1, raster.height - 1); ++v) {
      for (int u = std::max(x - far - 1, 0); u <= std::min(x + far + 1, raster.width - 1); ++u) {
        if (value(u, v) != value(x, y)) return far;
      }
    }
  }
  return 254;
}

TEST(MatteRaster, KnowsHowFarAllIsAlike) {
  EXPECT_TRUE(rc::check([] {
    Matte::Raster raster;
    raster.width = *rc::gen::element(1, 2, 3, 17, 40);
    raster.height = *rc::gen::element(1, 2, 5, 33);
    raster.values.assign(static_cast<std::size_t>(raster.width * raster.height),
                         MatteValue::kBackground);
    const int spots = *rc::gen::inRange(0, 6);
    for (int i = 0; i < spots; ++i) {
      const int x = *rc::gen::inRange(0, raster.width), y = *rc::gen::inRange(0, raster.height);
      raster.values[y * raster.width + x] =
          *rc::gen::element(MatteValue::kForeground, MatteValue::kUnseen);
    }
    raster.compute_uniform_radius();
    for (int y = 0; y < raster.height; ++y) {
      for (int x = 0; x < raster.width; ++x) {
        const int found = raster.uniform_radius.values[y * raster.width + x];
        RC_ASSERT(found == alike_around(raster, x, y));
      }
    }
  }));
}

TEST(MatteRaster, CountsNoFurtherThanAByteHolds) {
  Matte::Raster raster;
  raster.width = 700;
  raster.height = 1;
  raster.values.assign(700, MatteValue::kForeground);
  raster.values[0] = MatteValue::kBackground;
  raster.compute_uniform_radius();
  EXPECT_EQ(raster.uniform_radius.values[0], 0);
  EXPECT_EQ(raster.uniform_radius.values[1], 0);
  EXPECT_EQ(raster.uniform_radius.values[100], 99);
  EXPECT_EQ(raster.uniform_radius.values[600], 254);
}

}  // namespace
}  // namespace raystage::render
