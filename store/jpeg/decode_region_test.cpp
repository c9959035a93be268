// SPDX-License-Identifier: Apache-2.0
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>

#include "base/error.h"
#include "store/jpeg/decode.h"
#include "store/jpeg/encode.h"
#include "store/jpeg/inverse_dct.h"
#include "testing/store/test_encoder.h"
#include "testing/store/test_images.h"
#include "testing/test_data.h"
#include "testing/test_simd_targets.h"

namespace raystage::store {
namespace {

using testing::encode_jpeg_variant;
using testing::JpegVariant;
using testing::Kind;
using Bytes = std::vector<std::byte>;

constexpr std::uint16_t kUntouched = 12345;  // no value of the table

LinearTable injective_table() {
  LinearTable table;
  for (std::size_t c = 0; c < 3; ++c)
    for (std::size_t code = 0; code < 256; ++code)
      table.code[c][code] = static_cast<std::uint16_t>(code * 257 ^ (c * 21845));
  return table;
}

bool all_wanted(const JpegLayout& layout, const McuMask& wanted, int column, int row) {
  if (column < 0 || row < 0 || column >= layout.mcus_per_row || row >= layout.mcu_rows) return true;
  const int mcu = row * layout.mcus_per_row + column;
  return wanted[mcu] != 0;
}

// Returns whether decode_region guarantees this pixel of a wanted MCU: no unwanted MCU is within
// one pixel.
bool promised(const JpegLayout& layout, const McuMask& wanted, int x, int y) {
  for (const int dy : {-1, 0, 1})
    for (const int dx : {-1, 0, 1})
      if (x + dx >= 0 && y + dy >= 0 &&
          !all_wanted(layout, wanted, (x + dx) / layout.mcu_width, (y + dy) / layout.mcu_height))
        return false;
  return true;
}

struct Decoded {
  JpegLayout layout;
  std::int64_t pixels = 0;
  std::vector<std::uint16_t> rgba;
};

Decoded decode_region(JpegDecoder& decoder, const Bytes& jpeg, const McuMask& wanted) {
  Decoded decoded;
  decoded.layout = parse_jpeg_layout(jpeg, "x");
  decoded.rgba.assign(4 * static_cast<std::size_t>(decoded.layout.width) *
                          static_cast<std::size_t>(decoded.layout.height),
                      kUntouched);
  decoded.pixels =
      decoder.decode_region(jpeg, decoded.layout, wanted, injective_table(), decoded.rgba, "x");
  return decoded;
}

// Checks that every guaranteed pixel equals decode()'s, and that unwanted pixels are untouched.
void expect_region(JpegDecoder& decoder, const Bytes& jpeg, const McuMask& wanted,
                   const RgbImage& whole) {
  const Decoded decoded = decode_region(decoder, jpeg, wanted);
  const JpegLayout& layout = decoded.layout;
  const LinearTable table = injective_table();
  for (int y = 0; y < layout.height; ++y) {
    for (int x = 0; x < layout.width; ++x) {
      const auto pixel = static_cast<std::size_t>(y) * static_cast<std::size_t>(layout.width) +
                         static_cast<std::size_t>(x);
      const auto* got = &decoded.rgba[4 * pixel];
      if (!all_wanted(layout, wanted, x / layout.mcu_width, y / layout.mcu_height)) {
        ASSERT_TRUE(std::all_of(got, got + 4, [](auto v) { return v == kUntouched; }));
        continue;
      }
      ASSERT_EQ(got[3], 65535);
      if (!promised(layout, wanted, x, y)) continue;
      for (std::size_t c = 0; c < 3; ++c)
        ASSERT_EQ(got[c], table.code[c][whole.values[3 * pixel + c]])
            << "pixel " << x << ", " << y << " channel " << c;
    }
  }
}

McuMask random_mask(const JpegLayout& layout, std::mt19937& random) {
  McuMask wanted(static_cast<std::size_t>(layout.mcu_count()), 0);
  const auto columns = static_cast<unsigned>(layout.mcus_per_row);
  const auto rows = static_cast<unsigned>(layout.mcu_rows);
  for (int rectangle = 0; rectangle < 3; ++rectangle) {
    const unsigned left = random() % columns, top = random() % rows;
    const unsigned right = left + random() % (columns - left) + 1;
    const unsigned bottom = top + random() % (rows - top) + 1;
    for (unsigned row = top; row < bottom; ++row)
      for (unsigned column = left; column < right; ++column)
        wanted[row * columns + column] = static_cast<std::uint8_t>(1 + random() % 255);
  }
  return wanted;
}

// Checks full, empty and random masks.
void expect_regions(const Bytes& jpeg, const std::string& what) {
  SCOPED_TRACE(what);
  JpegDecoder decoder;
  std::mt19937 random(7);
  const RgbImage whole = decoder.decode(jpeg, "x");
  const JpegLayout layout = parse_jpeg_layout(jpeg, "x");
  const McuMask all(static_cast<std::size_t>(layout.mcu_count()), 1);
  expect_region(decoder, jpeg, all, whole);
  expect_region(decoder, jpeg, McuMask(all.size(), 0), whole);
  for (int i = 0; i < 4; ++i) expect_region(decoder, jpeg, random_mask(layout, random), whole);
}

TEST(DecodeRegion, EqualsTheFullDecodeForEverySampling) {
  const std::pair<int, int> samplings[] = {{1, 1}, {2, 1}, {1, 2}, {2, 2}, {4, 1}, {1, 4}, {4, 2}};
  const std::pair<int, int> sizes[] = {{1, 1}, {2, 2},   {3, 5},   {4, 3},   {5, 9},
                                       {8, 8}, {17, 16}, {33, 31}, {64, 48}, {131, 75}};
  for (const auto& [h, v] : samplings) {
    for (const auto& [width, height] : sizes) {
      JpegVariant odd;
      odd.h[0] = h;
      odd.v[0] = v;
      odd.quality = 60 + (width * 7 + h) % 41;
      const RgbImage image = testing::make(Kind::kMixed, width, height);
      for (const int interval : {0, 1, 2, 3, 5, 1000}) {
        odd.restart_interval = interval;
        expect_regions(encode_jpeg_variant(image, odd),
                       std::to_string(width) + "x" + std::to_string(height) + " sampling " +
                           std::to_string(h) + "x" + std::to_string(v) + " interval " +
                           std::to_string(interval));
      }
    }
  }
}

TEST(DecodeRegion, EqualsTheFullDecodeForUnusualSamplings) {
  // Chroma finer than luma, and chroma components that differ.
  const int samplings[][6] = {{1, 1, 2, 2, 2, 2}, {2, 2, 2, 1, 1, 2}, {2, 1, 1, 1, 2, 1},
                              {1, 2, 1, 2, 1, 1}, {2, 2, 1, 1, 2, 2}, {1, 1, 1, 1, 2, 2},
                              {3, 1, 1, 1, 1, 1}, {1, 3, 1, 1, 1, 1}, {2, 1, 2, 1, 2, 1}};
  for (const auto& sampling : samplings) {
    for (const int width : {3, 41, 100}) {
      JpegVariant odd;
      for (int c = 0; c < 3; ++c) {
        odd.h[c] = sampling[2 * c];
        odd.v[c] = sampling[2 * c + 1];
      }
      odd.restart_interval = 3;
      const RgbImage image = testing::make(Kind::kMixed, width, 53);
      expect_regions(encode_jpeg_variant(image, odd), ::testing::PrintToString(sampling));
    }
  }
}

TEST(DecodeRegion, EqualsTheFullDecodeForEveryKindOfPicture) {
  for (const Kind kind : {Kind::kNoise, Kind::kGradient, Kind::kEdges, Kind::kMixed}) {
    for (const int quality : {1, 10, 50, 90, 100}) {
      for (const int interval : {0, 2, 13}) {
        JpegVariant odd;
        odd.h[0] = odd.v[0] = 2;
        odd.quality = quality;
        odd.restart_interval = interval;
        odd.optimised = quality > 50;
        const RgbImage image = testing::make(kind, 200, 130);
        expect_regions(encode_jpeg_variant(image, odd), std::to_string(quality));
        odd.h[0] = odd.v[0] = 1;
        odd.grey = quality == 90;
        expect_regions(encode_jpeg_variant(image, odd), std::to_string(quality));
      }
    }
  }
}

TEST(DecodeRegion, EqualsTheFullDecodeOnEveryInstructionSet) {
  const RgbImage image = testing::make(Kind::kMixed, 200, 130);
  testing::for_each_simd_target(inverse_dct_target, [&] {
    for (const auto& [h, v] : {std::pair{1, 1}, {2, 1}, {1, 2}, {2, 2}}) {
      JpegVariant odd;
      odd.h[0] = h;
      odd.v[0] = v;
      odd.restart_interval = 3;
      expect_regions(encode_jpeg_variant(image, odd), "sampling");
    }
  });
}

TEST(DecodeRegion, FallsBackToTheFullDecode) {
  const RgbImage image = testing::make(Kind::kMixed, 75, 43);
  JpegVariant progressive, rgb, planes, arithmetic;
  progressive.progressive = rgb.rgb = arithmetic.arithmetic = true;
  planes.interleaved = false;
  for (const JpegVariant& odd : {progressive, rgb, planes, arithmetic}) {
    const Bytes jpeg = encode_jpeg_variant(image, odd);
    EXPECT_FALSE(parse_jpeg_layout(jpeg, "x").baseline_ycc);
    expect_regions(jpeg, "fall-back");
  }
}

TEST(DecodeRegion, ImpliesTheStandardHuffmanTables) {
  JpegVariant odd;
  odd.restart_interval = 2;
  const RgbImage image = testing::make(Kind::kMixed, 75, 43);
  expect_regions(testing::without_huffman_tables(encode_jpeg_variant(image, odd)), "no DHT");
}

TEST(DecodeRegion, CountsWhatItDecodes) {
  const RgbImage image = testing::make(Kind::kMixed, 101, 50);  // 7 x 4 MCUs of 16 x 16
  JpegDecoder decoder;
  const auto pixels = [&](int interval, std::initializer_list<std::size_t> mcus) {
    McuMask wanted(28, 0);
    for (const std::size_t mcu : mcus) wanted[mcu] = 1;
    const Bytes jpeg = encode_jpeg(image, {90, JpegEncodeOptions::Chroma::k420, interval});
    return decode_region(decoder, jpeg, wanted).pixels;
  };
  EXPECT_EQ(pixels(1, {0, 5, 27}), 3 * 256);
  EXPECT_EQ(pixels(3, {1}), 2 * 256);  // up to the wanted one
  EXPECT_EQ(pixels(3, {2, 3, 4}), 5 * 256);
  EXPECT_EQ(pixels(3, {27}), 256);      // the last segment is short
  EXPECT_EQ(pixels(0, {9}), 10 * 256);  // no segments: from the start
  EXPECT_EQ(pixels(0, {}), 0);
}

TEST(DecodeRegion, RefusesDamageAndGoesOnWithTheNextFrame) {
  const RgbImage image = testing::make(Kind::kMixed, 131, 75);
  const Bytes good = encode_jpeg(image, {90, JpegEncodeOptions::Chroma::k420, 4});
  const JpegLayout layout = parse_jpeg_layout(good, "x");
  const McuMask all(static_cast<std::size_t>(layout.mcu_count()), 1);
  JpegDecoder decoder;
  const RgbImage whole = decoder.decode(good, "x");
  int refused_by_both = 0, refused_by_one = 0;
  std::mt19937 random(3);
  for (int i = 0; i < 300; ++i) {
    Bytes bad = good;
    const std::size_t at = layout.scan_offset + random() % (layout.scan_end - layout.scan_offset);
    if (i % 2 == 0) {
      bad.erase(bad.begin() + static_cast<std::ptrdiff_t>(at));
    } else {
      bad[at] = static_cast<std::byte>(random());
    }
    const auto refused = [&](const auto& decode) {
      try {
        decode();
        return false;
      } catch (const Error& error) {
        EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
        return true;
      }
    };
    const bool by_reference = refused([&] { decoder.decode(bad, "x"); });
    const bool by_region = refused([&] { decode_region(decoder, bad, all); });
    EXPECT_EQ(by_reference, by_region) << i;
    (by_reference && by_region ? refused_by_both : refused_by_one) += by_reference || by_region;
    if (by_region) expect_region(decoder, good, all, whole);
  }
  EXPECT_GT(refused_by_both, 100);
  EXPECT_EQ(refused_by_one, 0);
}

// The layout of a frame on another host comes in a message of its own.
TEST(DecodeRegion, RefusesALayoutOfAnotherFrame) {
  const RgbImage image = testing::make(Kind::kMixed, 131, 75);
  const Bytes segmented = encode_jpeg(image, {90, JpegEncodeOptions::Chroma::k420, 4});
  const Bytes progressive = encode_jpeg_variant(image, {.progressive = true});
  JpegDecoder decoder;
  const auto expect_refusal = [&](std::span<const std::byte> jpeg, const JpegLayout& layout) {
    const McuMask all(static_cast<std::size_t>(layout.mcu_count()), 1);
    std::vector<std::uint16_t> rgba(4 * static_cast<std::size_t>(layout.width) *
                                    static_cast<std::size_t>(layout.height));
    EXPECT_THROW(decoder.decode_region(jpeg, layout, all, injective_table(), rgba, "x"), Error);
  };
  JpegLayout layout = parse_jpeg_layout(segmented, "x");
  expect_refusal(std::span(segmented).first(layout.scan_offset - 1), layout);
  expect_refusal(std::span(segmented).first(layout.scan_end), layout);
  layout.sof_offset = 0;
  expect_refusal(segmented, layout);
  layout = parse_jpeg_layout(progressive, "x");
  ASSERT_FALSE(layout.baseline_ycc);
  layout.height = layout.mcu_height * layout.mcu_rows;
  expect_refusal(progressive, layout);
}

TEST(DecodeRegion, EqualsTheFullDecodeOnPhotographs) {
  const auto data = testing::test_data();
  if (!std::filesystem::exists(data / "shop/cameras/r0c0.jpg"))
    GTEST_SKIP() << "no data sets at " << data;
  for (const char* name :
       {"shop/cameras/r0c0.jpg", "shop/cameras/r4c5.jpg", "stanford_chess9x9/images/r00_c00.jpg"}) {
    const Bytes jpeg = testing::read_bytes(data / name);
    expect_regions(jpeg, name);
    expect_regions(add_restart_markers(jpeg, -1, name), name);
    expect_regions(add_restart_markers(jpeg, 7, name), name);
  }
}

}  // namespace
}  // namespace raystage::store
