// SPDX-License-Identifier: Apache-2.0
#include "store/jpeg/decode.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <turbojpeg.h>

#include <string>

#include "base/error.h"
#include "store/jpeg/encode.h"
#include "testing/store/test_encoder.h"
#include "testing/store/test_images.h"

namespace raystage::store {
namespace {

using testing::encode_jpeg_variant;
using ::testing::HasSubstr;
using testing::JpegVariant;
using testing::Kind;
using Bytes = std::vector<std::byte>;

// Reference: decodes with turbojpeg.
RgbImage by_turbojpeg(const Bytes& jpeg) {
  const tjhandle handle = tjInitDecompress();
  RgbImage image;
  int subsampling = 0, color = 0;
  const auto* bytes = reinterpret_cast<const unsigned char*>(jpeg.data());
  EXPECT_EQ(tjDecompressHeader3(handle, bytes, jpeg.size(), &image.width, &image.height,
                                &subsampling, &color),
            0);
  image.values.resize(3 * static_cast<std::size_t>(image.width) *
                      static_cast<std::size_t>(image.height));
  EXPECT_EQ(tjDecompress2(handle, bytes, jpeg.size(), image.values.data(), image.width, 0,
                          image.height, TJPF_RGB, TJFLAG_ACCURATEDCT),
            0);
  tjDestroy(handle);
  return image;
}

TEST(DecodeJpeg, IsLibjpegTurbosOwn) {
  const RgbImage image = testing::make(Kind::kMixed, 75, 43);
  JpegDecoder decoder;
  for (const int h : {1, 2}) {
    for (const int v : {1, 2}) {
      JpegVariant odd;
      odd.h[0] = h;
      odd.v[0] = v;
      const Bytes bytes = encode_jpeg_variant(image, odd);
      EXPECT_EQ(decoder.decode(bytes, "x"), by_turbojpeg(bytes)) << h << v;
      odd.progressive = true;
      EXPECT_EQ(decoder.decode(encode_jpeg_variant(image, odd), "x"), by_turbojpeg(bytes))
          << h << v;
    }
  }
}

TEST(DecodeJpeg, ScaledPicturesAreLikeTheMeanOfTheirPixels) {
  const RgbImage image = testing::make(Kind::kGradient, 75, 43);
  const Bytes bytes = encode_jpeg_variant(image, {});
  JpegDecoder decoder;
  EXPECT_EQ(decoder.decode_scaled(bytes, 1, "x"), decoder.decode(bytes, "x"));
  const RgbImage whole = decoder.decode(bytes, "x");
  for (const int divisor : {2, 4, 8}) {
    const RgbImage small = decoder.decode_scaled(bytes, divisor, "x");
    EXPECT_EQ(small.width, (75 + divisor - 1) / divisor);
    EXPECT_EQ(small.height, (43 + divisor - 1) / divisor);
    for (int y = 1; y + 1 < small.height; ++y) {
      for (int x = 1; x + 1 < small.width; ++x) {
        double mean = 0;
        for (int i = 0; i < divisor * divisor; ++i) {
          mean += whole.at(x * divisor + i % divisor, y * divisor + i / divisor, 1);
        }
        EXPECT_NEAR(small.at(x, y, 1), mean / (divisor * divisor), 4) << divisor;
      }
    }
  }
  EXPECT_THROW(decoder.decode_scaled(std::span(bytes).first(bytes.size() / 2), 8, "x"), Error);
}

TEST(DecodeJpeg, GreyGivesEqualChannels) {
  JpegVariant grey;
  grey.grey = true;
  JpegDecoder decoder;
  const RgbImage image =
      decoder.decode(encode_jpeg_variant(testing::make(Kind::kMixed, 75, 43), grey), "x");
  for (std::size_t i = 0; i < image.values.size(); i += 3) {
    ASSERT_EQ(image.values[i], image.values[i + 1]);
    ASSERT_EQ(image.values[i], image.values[i + 2]);
  }
}

TEST(DecodeJpeg, ImpliesTheStandardHuffmanTables) {
  const Bytes with = encode_jpeg_variant(testing::make(Kind::kMixed, 75, 43), {});
  const Bytes without = testing::without_huffman_tables(with);
  ASSERT_LT(without.size(), with.size());
  JpegDecoder decoder;
  const RgbImage expected = decoder.decode(with, "x");
  EXPECT_EQ(decoder.decode(without, "x"), expected);
  JpegVariant optimised;
  optimised.optimised = true;
  decoder.decode(encode_jpeg_variant(testing::make(Kind::kGradient, 75, 43), optimised), "x");
  EXPECT_EQ(decoder.decode(without, "x"), expected);  // not with the previous frame's tables
}

TEST(DecodeJpeg, AcceptsFillerAtTheEndOfTheScanOnly) {
  const Bytes bytes = encode_jpeg_variant(testing::make(Kind::kMixed, 75, 43), {});
  JpegDecoder decoder;
  const RgbImage image = decoder.decode(bytes, "x");
  Bytes padded = bytes;
  padded.insert(padded.end() - 2, 37, std::byte{0});
  EXPECT_EQ(decoder.decode(padded, "x"), image);
  Bytes garbage = bytes;
  garbage.insert(garbage.end() - 2, 37, std::byte{0x5A});
  EXPECT_THROW(decoder.decode(garbage, "x"), Error);
}

TEST(DecodeJpeg, RefusesDamageAndGoesOnWithTheNextFrame) {
  const RgbImage image = testing::make(Kind::kMixed, 75, 43);
  const Bytes bytes = encode_jpeg_variant(image, {});
  JpegDecoder decoder;
  const RgbImage expected = decoder.decode(bytes, "x");
  Bytes cut = bytes;
  cut.erase(cut.end() - 300, cut.end() - 2);
  for (int repeat = 0; repeat < 3; ++repeat) {
    try {
      decoder.decode(cut, "cam3 frame 8");
      FAIL() << "decoded a truncated frame";
    } catch (const Error& error) {
      EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
      EXPECT_THAT(error.what(), HasSubstr("cam3 frame 8"));
    }
    EXPECT_EQ(decoder.decode(bytes, "x"), expected);
  }
}

TEST(DecodeJpeg, CanBeMoved) {
  JpegDecoder first;
  const Bytes bytes = encode_jpeg_variant(testing::make(Kind::kMixed, 20, 20), {});
  const RgbImage image = first.decode(bytes, "x");
  JpegDecoder second = std::move(first);
  EXPECT_EQ(second.decode(bytes, "x"), image);
}

}  // namespace
}  // namespace raystage::store
