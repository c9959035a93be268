// SPDX-License-Identifier: Apache-2.0
#include "ingest/sources/frame_source.h"

#include <gtest/gtest.h>

#include <ctime>

namespace raystage::ingest {
namespace {

TEST(RawImage, CountsTheBytesOfItsPlanes) {
  const auto bytes = [](store::PixelFormat format, int width, int height) {
    store::RawImage image;
    image.format = format;
    image.width = width;
    image.height = height;
    return image.bytes();
  };
  EXPECT_EQ(bytes(store::PixelFormat::kYuv420, 640, 480), 640U * 480 * 3 / 2);
  // Odd sizes: chroma is rounded up, as in JPEG.
  EXPECT_EQ(bytes(store::PixelFormat::kYuv420, 5, 3), 15U + 2 * 3 * 2);
  EXPECT_EQ(bytes(store::PixelFormat::kYuv422, 5, 3), 15U + 2 * 3 * 3);
  EXPECT_EQ(bytes(store::PixelFormat::kYuv444, 5, 3), 45U);
  EXPECT_EQ(bytes(store::PixelFormat::kGray, 5, 3), 15U);
  EXPECT_EQ(bytes(store::PixelFormat::kRgb, 5, 3), 45U);
  EXPECT_EQ(bytes(store::PixelFormat::kBgr, 65500, 65500), 65500ULL * 65500 * 3);
}

TEST(HostClock, CountsFrom1970) {
  timespec now{};
  clock_gettime(CLOCK_REALTIME, &now);
  const Nanoseconds expected = now.tv_sec * kNanosecondsPerSecond + now.tv_nsec;
  EXPECT_NEAR(static_cast<double>(host_utc_now() - expected), 0, 1e9);
}

}  // namespace
}  // namespace raystage::ingest
