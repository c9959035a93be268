// SPDX-License-Identifier: Apache-2.0
#include "store/jpeg/encode.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <limits>

#include "base/error.h"
#include "store/jpeg/decode.h"
#include "store/jpeg/libjpeg.h"
#include "testing/store/test_encoder.h"
#include "testing/store/test_images.h"
#include "testing/test_data.h"

namespace raystage::store {
namespace {

using testing::encode_jpeg_variant;
using testing::JpegVariant;
using testing::Kind;
using Bytes = std::vector<std::byte>;
using Chroma = JpegEncodeOptions::Chroma;

double psnr(const RgbImage& a, const RgbImage& b) {
  double sum = 0;
  for (std::size_t i = 0; i < a.values.size(); ++i) sum += std::pow(a.values[i] - b.values[i], 2);
  return 10 * std::log10(255 * 255 / (sum / static_cast<double>(a.values.size()) + 1e-9));
}

// Returns all quantised coefficients of a file, block by block.
std::vector<JCOEF> coefficients(const Bytes& jpeg) {
  std::vector<JCOEF> all;
  libjpeg::Decompressor source;
  jpeg_decompress_struct& info = source.info;
  jvirt_barray_ptr* arrays = nullptr;
  if (!libjpeg::guarded(source.errors, [&] {
        source.set_input(jpeg);
        jpeg_read_header(&info, TRUE);
        arrays = jpeg_read_coefficients(&info);
      }))
    libjpeg::throw_error(source.errors, "test");
  for (int c = 0; c < info.num_components; ++c) {
    const jpeg_component_info& component = info.comp_info[c];
    for (JDIMENSION row = 0; row < component.height_in_blocks; ++row) {
      JBLOCKARRAY blocks = info.mem->access_virt_barray(reinterpret_cast<j_common_ptr>(&info),
                                                        arrays[c], row, 1, FALSE);
      for (JDIMENSION column = 0; column < component.width_in_blocks; ++column)
        all.insert(all.end(), blocks[0][column], blocks[0][column] + DCTSIZE2);
    }
  }
  return all;
}

TEST(EncodeJpeg, ComesBackNearlyTheSame) {
  const RgbImage image = testing::make(Kind::kGradient, 130, 77);
  JpegDecoder decoder;
  for (const Chroma chroma : {Chroma::k444, Chroma::k422, Chroma::k420}) {
    const RgbImage back = decoder.decode(encode_jpeg(image, {95, chroma, -1}), "x");
    ASSERT_EQ(back.width, image.width);
    ASSERT_EQ(back.height, image.height);
    EXPECT_GT(psnr(image, back), 38);
  }
  const RgbImage edges = testing::make(Kind::kEdges, 130, 77);
  EXPECT_GT(psnr(edges, decoder.decode(encode_jpeg(edges, {}), "x")), 30);
}

TEST(EncodeJpeg, RestartMarkersDoNotChangePixels) {
  const RgbImage image = testing::make(Kind::kMixed, 130, 77);
  JpegDecoder decoder;
  const RgbImage plain = decoder.decode(encode_jpeg(image, {90, Chroma::k420, 0}), "x");
  for (const int interval : {-1, 1, 5, 9, 65535})
    EXPECT_EQ(decoder.decode(encode_jpeg(image, {90, Chroma::k420, interval}), "x"), plain);
}

TEST(EncodeJpeg, SegmentsAre32PixelsWideByDefaultAndHalfThatInSmallFrames) {
  const auto interval = [](int width, Chroma chroma) {
    const RgbImage image = testing::make(Kind::kMixed, width, 77);
    return parse_jpeg_layout(encode_jpeg(image, {90, chroma, -1}), "x").restart_interval;
  };
  EXPECT_EQ(interval(640, Chroma::k444), 4);
  EXPECT_EQ(interval(640, Chroma::k420), 2);
  EXPECT_EQ(interval(639, Chroma::k444), 2);
  EXPECT_EQ(interval(639, Chroma::k420), 1);
  EXPECT_EQ(default_restart_interval(640, 32), 1);
}

TEST(EncodeJpeg, RefusesWhatItCannotEncode) {
  const RgbImage image = testing::make(Kind::kMixed, 8, 8);
  EXPECT_THROW(encode_jpeg({0, 8, {}}, {}), Error);
  EXPECT_THROW(encode_jpeg({65501, 1, std::vector<std::uint8_t>(3 * 65501)}, {}), Error);
  EXPECT_THROW(encode_jpeg({8, 9, image.values}, {}), Error);
  EXPECT_THROW(encode_jpeg(image, {0, Chroma::k444, -1}), Error);
  EXPECT_THROW(encode_jpeg(image, {101, Chroma::k444, -1}), Error);
  EXPECT_THROW(encode_jpeg(image, {90, Chroma::k444, -2}), Error);
  EXPECT_THROW(encode_jpeg(image, {90, Chroma::k444, 65536}), Error);
  EXPECT_NO_THROW(encode_jpeg({65500, 1, std::vector<std::uint8_t>(3 * 65500)}, {}));
}

void expect_same_picture(const Bytes& before, int interval, const std::string& what) {
  SCOPED_TRACE(what);
  const Bytes after = add_restart_markers(before, interval, what);
  const JpegLayout layout = parse_jpeg_layout(after, "x");
  const int expected =
      interval < 0 ? default_restart_interval(layout.width, layout.mcu_width) : interval;
  EXPECT_EQ(layout.restart_interval, layout.baseline_ycc ? expected : 0);
  EXPECT_EQ(coefficients(before), coefficients(after));
  JpegDecoder decoder;
  EXPECT_EQ(decoder.decode(before, what + " before"), decoder.decode(after, what + " after"));
}

TEST(AddRestartMarkers, KeepsCoefficientsAndPixels) {
  for (const auto& [width, height] : {std::pair{1, 1}, {17, 9}, {64, 48}, {131, 75}}) {
    const RgbImage image = testing::make(Kind::kMixed, width, height);
    for (const int h : {1, 2}) {
      for (const int v : {1, 2}) {
        for (const bool progressive : {false, true}) {
          JpegVariant odd;
          odd.h[0] = h;
          odd.v[0] = v;
          odd.progressive = progressive;
          const Bytes bytes = encode_jpeg_variant(image, odd);
          for (const int interval : {-1, 1, 3})
            expect_same_picture(bytes, interval,
                                std::to_string(width) + " " + std::to_string(h) +
                                    std::to_string(v) + (progressive ? " progressive" : ""));
        }
      }
    }
  }
}

TEST(AddRestartMarkers, KeepsOddPictures) {
  const RgbImage image = testing::make(Kind::kMixed, 75, 43);
  JpegVariant grey, rgb, planes, again, arithmetic;
  grey.grey = rgb.rgb = arithmetic.arithmetic = true;
  planes.interleaved = false;
  again.restart_interval = 7;
  expect_same_picture(encode_jpeg_variant(image, grey), -1, "grey");
  expect_same_picture(encode_jpeg_variant(image, rgb), -1, "RGB");
  expect_same_picture(encode_jpeg_variant(image, planes), 2, "a scan per component");
  expect_same_picture(encode_jpeg_variant(image, again), 2, "other restart markers before");
  expect_same_picture(encode_jpeg_variant(image, arithmetic), 2, "arithmetic");
  expect_same_picture(testing::without_huffman_tables(encode_jpeg_variant(image, {})), -1,
                      "no DHT");
}

TEST(AddRestartMarkers, KeepsApplicationMarkersAndComments) {
  JpegVariant odd;
  odd.markers = true;
  const RgbImage image = testing::make(Kind::kMixed, 75, 43);
  const auto markers_of = [](const Bytes& jpeg) {
    std::vector<Bytes> found;
    for (std::size_t at = 2; jpeg[at + 1] != std::byte{0xDA};) {
      const std::size_t length = std::to_integer<std::size_t>(jpeg[at + 2]) << 8 |
                                 std::to_integer<std::size_t>(jpeg[at + 3]);
      const auto begin = jpeg.begin() + static_cast<std::ptrdiff_t>(at);
      if (jpeg[at + 1] == std::byte{0xFE} || (jpeg[at + 1] & std::byte{0xF0}) == std::byte{0xE0})
        found.emplace_back(begin, begin + static_cast<std::ptrdiff_t>(length + 2));
      at += length + 2;
    }
    return found;
  };
  const Bytes before = encode_jpeg_variant(image, odd);
  EXPECT_EQ(markers_of(before).size(), 3u);  // JFIF, APP1, COM
  EXPECT_EQ(markers_of(before), markers_of(add_restart_markers(before, -1, "x")));
}

TEST(AddRestartMarkers, RefusesDamage) {
  const RgbImage image = testing::make(Kind::kMixed, 75, 43);
  Bytes bytes = encode_jpeg_variant(image, {});
  EXPECT_THROW(add_restart_markers(Bytes(bytes.begin(), bytes.end() - 100), -1, "x"), Error);
  Bytes cut = bytes;  // with its EOI
  cut.erase(cut.end() - 300, cut.end() - 2);
  EXPECT_THROW(add_restart_markers(cut, -1, "x"), Error);
  EXPECT_THROW(add_restart_markers(bytes, -2, "x"), Error);
  EXPECT_THROW(add_restart_markers(bytes, 70000, "x"), Error);
}

TEST(AddRestartMarkers, CostsLittleOnPhotographs) {
  const auto file = testing::test_data() / "shop/cameras/r0c0.jpg";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << "no data set at " << file;
  const Bytes before = testing::read_bytes(file);
  expect_same_picture(before, -1, "shop");
  const auto growth = static_cast<double>(add_restart_markers(before, -1, "x").size()) /
                      static_cast<double>(before.size());
  EXPECT_LT(growth, 1.05);
}

}  // namespace
}  // namespace raystage::store
