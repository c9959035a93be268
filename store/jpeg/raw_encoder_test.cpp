// SPDX-License-Identifier: Apache-2.0
#include "store/jpeg/raw_encoder.h"

#include <gtest/gtest.h>
#include <turbojpeg.h>

#include <cstring>
#include <memory>
#include <random>
#include <utility>

#include "base/error.h"
#include "store/jpeg/decode.h"
#include "store/jpeg/layout.h"
#include "testing/store/test_images.h"

namespace raystage::store {
namespace {

using Bytes = std::vector<std::byte>;

// Returns noise in planes with padded rows, as drivers deliver. The first padding byte and one
// extra row repeat the last sample, because libjpeg-turbo's planar interface reads luma of even
// size.
RawImage make_raw(PixelFormat format, int width, int height, std::size_t padding) {
  RawImage image;
  image.format = format;
  image.width = width;
  image.height = height;
  auto pixels = std::make_shared<std::vector<std::byte>>();
  std::array<std::size_t, 3> start{};
  std::mt19937 random(7);
  for (int p = 0; p < image.plane_count(); ++p) {
    start[p] = pixels->size();
    const std::size_t bytes = image.row_bytes(p);
    for (int y = 0; y <= image.rows(p); ++y) {
      if (y == image.rows(p)) {
        const std::vector<std::byte> last(
            pixels->end() - static_cast<std::ptrdiff_t>(bytes + padding), pixels->end());
        pixels->insert(pixels->end(), last.begin(), last.end());
        break;
      }
      for (std::size_t x = 0; x < bytes; ++x) {
        pixels->push_back(static_cast<std::byte>(60 + (3 * static_cast<int>(x) + 5 * y) % 120 +
                                                 static_cast<int>(random() % 20)));
      }
      for (std::size_t x = 0; x < padding; ++x) {
        pixels->push_back(x == 0 ? pixels->back() : std::byte{0});
      }
    }
  }
  for (int p = 0; p < image.plane_count(); ++p) {
    image.planes[p] = {pixels->data() + start[p], image.row_bytes(p) + padding};
  }
  image.owner = pixels;
  return image;
}

// Reference: encodes with libjpeg-turbo's planar interface.
Bytes encode_by_turbojpeg(const RawImage& image, int subsampling, int quality) {
  const std::unique_ptr<void, int (*)(tjhandle)> handle(tjInitCompress(), tjDestroy);
  std::array<const unsigned char*, 3> planes{};
  std::array<int, 3> strides{};
  for (std::size_t p = 0; p < 3; ++p) {
    planes[p] = reinterpret_cast<const unsigned char*>(image.planes[p].data);
    strides[p] = static_cast<int>(image.planes[p].stride);
  }
  unsigned char* out = nullptr;
  unsigned long size = 0;
  EXPECT_EQ(
      tjCompressFromYUVPlanes(handle.get(), planes.data(), image.width, strides.data(),
                              image.height, subsampling, &out, &size, quality, TJFLAG_ACCURATEDCT),
      0);
  Bytes bytes(size);
  std::memcpy(bytes.data(), out, size);
  tjFree(out);
  return bytes;
}

TEST(RawJpegEncoder, PlanesAreEncodedAsLibjpegTurboDoes) {
  JpegDecoder decoder;
  RawJpegEncoder encoder({.quality = 85, .restart_interval = 0});
  for (const auto& [format, subsampling] :
       {std::pair(PixelFormat::kYuv420, TJSAMP_420), std::pair(PixelFormat::kYuv422, TJSAMP_422),
        std::pair(PixelFormat::kYuv444, TJSAMP_444)}) {
    for (const auto& [width, height] : {std::pair(64, 48), std::pair(97, 35), std::pair(1, 1),
                                        std::pair(15, 17), std::pair(33, 8)}) {
      const RawImage image = make_raw(format, width, height, 5);
      Bytes bytes;
      encoder.encode(image, bytes);
      EXPECT_EQ(decoder.decode(bytes, "ours"),
                decoder.decode(encode_by_turbojpeg(image, subsampling, 85), "turbojpeg"))
          << width << "x" << height << " format " << static_cast<int>(format);
    }
  }
}

TEST(RawJpegEncoder, RgbAndBgrEqualTheOtherEncoder) {
  const RgbImage rgb = testing::make(testing::Kind::kMixed, 75, 41);
  RgbImage bgr = rgb;
  for (std::size_t i = 0; i < bgr.values.size(); i += 3)
    std::swap(bgr.values[i], bgr.values[i + 2]);
  for (const auto chroma : {JpegEncodeOptions::Chroma::k444, JpegEncodeOptions::Chroma::k420}) {
    const JpegEncodeOptions options{92, chroma, -1};
    RawJpegEncoder encoder(options);
    for (const auto& [format, picture] :
         {std::pair(PixelFormat::kRgb, &rgb), std::pair(PixelFormat::kBgr, &std::as_const(bgr))}) {
      RawImage image;
      image.format = format;
      image.width = 75;
      image.height = 41;
      image.planes[0] = {reinterpret_cast<const std::byte*>(picture->values.data()),
                         std::size_t{3} * 75};
      Bytes bytes;
      encoder.encode(image, bytes);
      EXPECT_EQ(bytes, encode_jpeg(rgb, options));
    }
  }
}

TEST(RawJpegEncoder, GreyBecomesOneComponent) {
  const RawImage image = make_raw(PixelFormat::kGray, 50, 30, 3);
  RawJpegEncoder encoder({.quality = 100, .restart_interval = -1});
  Bytes bytes;
  encoder.encode(image, bytes);
  const RgbImage back = JpegDecoder().decode(bytes, "grey");
  for (int y = 0; y < 30; ++y) {
    for (int x = 0; x < 50; ++x) {
      const auto at = static_cast<std::size_t>(3 * (y * 50 + x));
      const auto expected = std::to_integer<int>(image.planes[0].data[y * 53 + x]);
      EXPECT_NEAR(back.values[at], expected, 2);
      EXPECT_EQ(back.values[at], back.values[at + 1]);
    }
  }
}

TEST(RawJpegEncoder, SizesMayChangeAndMarkersSuitThem) {
  RawJpegEncoder encoder({.quality = 90, .restart_interval = -1});
  Bytes bytes;
  for (const int width : {640, 32, 1000}) {
    encoder.encode(make_raw(PixelFormat::kYuv420, width, 48, 0), bytes);
    const JpegLayout layout = parse_jpeg_layout(bytes, "x");
    EXPECT_EQ(layout.width, width);
    EXPECT_EQ(layout.restart_interval, width < 640 ? 1 : 2);
  }
}

TEST(RawJpegEncoder, RefusesWhatNoJpegHolds) {
  EXPECT_THROW(RawJpegEncoder({.quality = 0}), Error);
  RawJpegEncoder encoder({});
  RawImage image = make_raw(PixelFormat::kGray, 8, 8, 0);
  image.width = 65501;
  Bytes bytes;
  EXPECT_THROW(encoder.encode(image, bytes), Error);
}

}  // namespace
}  // namespace raystage::store
