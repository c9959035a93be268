// SPDX-License-Identifier: Apache-2.0
#include "store/jpeg/layout.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <random>
#include <string>

#include "base/error.h"
#include "store/jpeg/encode.h"
#include "store/jpeg/marker_search.h"
#include "testing/store/test_encoder.h"
#include "testing/store/test_images.h"

namespace raystage::store {
namespace {

using testing::encode_jpeg_variant;
using ::testing::HasSubstr;
using testing::JpegVariant;
using Bytes = std::vector<std::byte>;
using Chroma = JpegEncodeOptions::Chroma;

Bytes sample(int width, int height, Chroma chroma, int interval) {
  return encode_jpeg(testing::make(testing::Kind::kNoise, width, height), {90, chroma, interval});
}

std::string refusal(const Bytes& bytes) {
  try {
    parse_jpeg_layout(bytes, "frame 7");
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_THAT(error.where(), HasSubstr("frame 7"));
    return error.what();
  }
  return "";
}

std::size_t find_marker(const Bytes& bytes, int code, std::size_t from = 0) {
  for (std::size_t i = from; i + 1 < bytes.size(); ++i)
    if (bytes[i] == std::byte{0xFF} && bytes[i + 1] == static_cast<std::byte>(code)) return i;
  return bytes.size();
}

TEST(JpegLayout, DescribesTheGeometry) {
  const JpegLayout layout = parse_jpeg_layout(sample(101, 50, Chroma::k420, 0), "x");
  EXPECT_EQ(layout.width, 101);
  EXPECT_EQ(layout.height, 50);
  EXPECT_EQ(layout.components, 3);
  EXPECT_EQ(layout.mcu_width, 16);
  EXPECT_EQ(layout.mcu_height, 16);
  EXPECT_EQ(layout.mcus_per_row, 7);
  EXPECT_EQ(layout.mcu_rows, 4);
  EXPECT_TRUE(layout.baseline_ycc);
  EXPECT_FALSE(layout.regions_decodable());
  EXPECT_EQ(layout.segment_count(), 1);
  const JpegLayout wide = parse_jpeg_layout(sample(101, 50, Chroma::k422, 0), "x");
  EXPECT_EQ(wide.mcu_width, 16);
  EXPECT_EQ(wide.mcu_height, 8);
}

TEST(JpegLayout, FindsEverySegment) {
  for (const int interval : {1, 2, 3, 7, 9, 28, 29, 1000}) {
    const Bytes bytes = sample(101, 50, Chroma::k420, interval);
    const JpegLayout layout = parse_jpeg_layout(bytes, "x");
    EXPECT_TRUE(layout.regions_decodable());
    EXPECT_EQ(layout.restart_interval, interval);
    ASSERT_EQ(layout.segment_count(), (28 + interval - 1) / interval);
    for (int s = 1; s < layout.segment_count(); ++s) {
      const std::size_t at = layout.segment_offset[s];
      EXPECT_EQ(bytes[at - 2], std::byte{0xFF});
      EXPECT_EQ(bytes[at - 1], static_cast<std::byte>(0xD0 + (s - 1) % 8));
    }
    EXPECT_EQ(layout.segment_offset.back(), bytes.size());
    EXPECT_EQ(layout.scan_end + 2, bytes.size());
    EXPECT_EQ(layout.segment_offset.front(), layout.scan_offset);
  }
}

TEST(JpegLayout, KnowsWhatCannotBeDecodedInParts) {
  const RgbImage image = testing::make(testing::Kind::kMixed, 40, 30);
  JpegVariant odd;
  odd.restart_interval = 2;
  EXPECT_TRUE(parse_jpeg_layout(encode_jpeg_variant(image, odd), "x").regions_decodable());
  for (int which = 0; which < 4; ++which) {
    JpegVariant what = odd;
    (which == 0   ? what.progressive
     : which == 1 ? what.arithmetic
     : which == 2 ? what.rgb
                  : what.interleaved) = which != 3;
    const JpegLayout layout = parse_jpeg_layout(encode_jpeg_variant(image, what), "x");
    EXPECT_FALSE(layout.baseline_ycc) << which;
    EXPECT_FALSE(layout.regions_decodable()) << which;
    EXPECT_EQ(layout.width, 40);
    EXPECT_EQ(layout.segment_count(), 1);
  }
}

TEST(JpegLayout, AGreyPicturesMcuIsOneBlockWhateverItsSampling) {
  JpegVariant grey;
  grey.grey = true;
  grey.h[0] = grey.v[0] = 2;
  grey.restart_interval = 3;
  const RgbImage image = testing::make(testing::Kind::kMixed, 40, 30);
  const JpegLayout layout = parse_jpeg_layout(encode_jpeg_variant(image, grey), "x");
  EXPECT_EQ(layout.components, 1);
  EXPECT_EQ(layout.mcu_width, 8);
  EXPECT_EQ(layout.mcus_per_row, 5);
  EXPECT_EQ(layout.segment_count(), 7);
}

TEST(JpegLayout, ScansAreLimited) {
  JpegVariant what;
  what.progressive = true;
  Bytes bytes = encode_jpeg_variant(testing::make(testing::Kind::kMixed, 40, 30), what);
  EXPECT_NO_THROW(parse_jpeg_layout(bytes, "x"));
  // The last scan again and again, as in a small file that takes hours to decode.
  std::size_t last = 0;
  for (std::size_t i = 0; i + 1 < bytes.size(); ++i) {
    if (bytes[i] == std::byte{0xFF} && bytes[i + 1] == std::byte{0xDA}) last = i;
  }
  const Bytes scan(bytes.begin() + static_cast<std::ptrdiff_t>(last), bytes.end() - 2);
  for (int i = 0; i < 100; ++i) bytes.insert(bytes.end() - 2, scan.begin(), scan.end());
  try {
    parse_jpeg_layout(bytes, "x");
    FAIL();
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("more than 100 scans"));
  }
}

TEST(JpegLayout, IgnoresBytesAfterTheEnd) {
  Bytes bytes = sample(40, 30, Chroma::k420, 1);
  const JpegLayout before = parse_jpeg_layout(bytes, "x");
  bytes.resize(bytes.size() + 100, std::byte{0xFF});
  EXPECT_EQ(parse_jpeg_layout(bytes, "x").segment_offset, before.segment_offset);
}

TEST(JpegLayout, AcceptsFillBytesBeforeMarkers) {
  Bytes bytes = sample(40, 30, Chroma::k420, 1);
  const JpegLayout before = parse_jpeg_layout(bytes, "x");
  for (const int code : {0xD9, 0xD1, 0xDA, 0xC0})
    bytes.insert(bytes.begin() + static_cast<std::ptrdiff_t>(find_marker(
                                     bytes, code, code == 0xD1 ? before.scan_offset : 2)),
                 2, std::byte{0xFF});
  EXPECT_EQ(parse_jpeg_layout(bytes, "x").segment_count(), before.segment_count());
}

TEST(FindRestartMarkers, EqualsTheObviousSearch) {
  std::mt19937 random(5);
  const std::uint8_t values[] = {0xFF, 0xFF, 0x00, 0xD0, 0xD7, 0x42, 0x42, 0x42, 0xD8};
  for (int repeat = 0; repeat < 2000; ++repeat) {
    Bytes bytes(random() % 300);
    const unsigned kinds = repeat % 2 == 0 ? 9 : 8;  // with or without another marker
    for (std::byte& b : bytes) b = static_cast<std::byte>(values[random() % kinds]);
    const std::size_t begin = bytes.empty() ? 0 : random() % bytes.size();
    std::vector<std::uint32_t> expected;
    for (std::size_t at = begin; at + 1 < bytes.size(); ++at) {
      const int code = std::to_integer<int>(bytes[at + 1]);
      if (bytes[at] != std::byte{0xFF} || code == 0 || code == 0xFF) continue;
      expected.push_back(static_cast<std::uint32_t>(at));
      if (code < 0xD0 || code > 0xD7) break;
    }
    ASSERT_EQ(find_restart_markers(bytes, begin), expected);
  }
}

TEST(JpegLayout, RefusesEveryTruncation) {
  const Bytes bytes = sample(40, 30, Chroma::k420, 1);
  for (std::size_t size = 0; size < bytes.size(); ++size)
    EXPECT_NE(refusal(Bytes(bytes.begin(), bytes.begin() + static_cast<std::ptrdiff_t>(size))), "")
        << size;
  EXPECT_EQ(refusal(bytes), "");
}

TEST(JpegLayout, RefusesLostAndSwappedSegments) {
  const Bytes bytes = sample(101, 50, Chroma::k420, 2);
  const JpegLayout layout = parse_jpeg_layout(bytes, "x");
  Bytes lost = bytes;
  lost.erase(lost.begin() + layout.segment_offset[3], lost.begin() + layout.segment_offset[4]);
  EXPECT_THAT(refusal(lost), HasSubstr("restart marker"));
  Bytes eight_lost = bytes;
  eight_lost.erase(eight_lost.begin() + layout.segment_offset[3],
                   eight_lost.begin() + layout.segment_offset[11]);
  EXPECT_THAT(refusal(eight_lost), HasSubstr("segments"));
  Bytes unannounced = bytes;
  const std::size_t dri = find_marker(bytes, 0xDD);
  unannounced.erase(unannounced.begin() + static_cast<std::ptrdiff_t>(dri),
                    unannounced.begin() + static_cast<std::ptrdiff_t>(dri + 6));
  EXPECT_THAT(refusal(unannounced), HasSubstr("DRI"));
}

TEST(JpegLayout, SaysWhatItDoesNotSupport) {
  const RgbImage image = testing::make(testing::Kind::kMixed, 40, 30);
  JpegVariant cmyk;
  cmyk.cmyk = true;
  EXPECT_THAT(refusal(encode_jpeg_variant(image, cmyk)), HasSubstr("4 components"));
  Bytes deep = sample(40, 30, Chroma::k444, 0);
  deep[find_marker(deep, 0xC0) + 4] = std::byte{12};
  EXPECT_THAT(refusal(deep), HasSubstr("12 bits"));
  Bytes lossless = sample(40, 30, Chroma::k444, 0);
  lossless[find_marker(lossless, 0xC0) + 1] = std::byte{0xC3};
  EXPECT_THAT(refusal(lossless), HasSubstr("SOF3"));
  EXPECT_THAT(refusal({}), HasSubstr("empty"));
  EXPECT_THAT(refusal(Bytes(100, std::byte{'P'})), HasSubstr("not a JPEG"));
}

TEST(JpegLayout, RefusesASizeThatItsBytesCannotFill) {
  Bytes huge = sample(8, 8, Chroma::k444, 0);
  const std::size_t sof = find_marker(huge, 0xC0);
  for (std::size_t i = 5; i < 9; ++i) huge[sof + i] = std::byte{0xFF};
  EXPECT_THAT(refusal(huge), HasSubstr("too short"));
}

}  // namespace
}  // namespace raystage::store
