// SPDX-License-Identifier: Apache-2.0
#include "store/processing/frames/incremental_decode.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <random>
#include <string>
#include <vector>

#include "store/jpeg/encode.h"
#include "testing/store/test_images.h"

namespace raystage::store {
namespace {

using Chroma = JpegEncodeOptions::Chroma;
constexpr std::uint16_t kUntouched = 12345;  // no value of the table

LinearTable plain_table() {
  LinearTable table;
  for (auto& channel : table.code) {
    for (std::size_t code = 0; code < 256; ++code) {
      channel[code] = static_cast<std::uint16_t>(code * 257);
    }
  }
  return table;
}

/// A picture that is decoded in several parts.
class Picture {
 public:
  Picture(Chroma chroma, int width, int height)
      : jpeg_(encode_jpeg(testing::make(testing::Kind::kMixed, width, height), {95, chroma, -1})),
        layout_(parse_jpeg_layout(jpeg_, "x")),
        whole_(decoder_.decode(jpeg_, "x")),
        frame_(4 * static_cast<std::size_t>(width) * static_cast<std::size_t>(height), kUntouched),
        held_(static_cast<std::size_t>(layout_.mcu_count())) {}

  const JpegLayout& layout() const { return layout_; }

  /// Adds MCUs and returns the number of pixels that were decoded for them.
  std::int64_t add(const McuMask& wanted) {
    const IncrementalDecode added(layout_, held_, wanted);
    std::vector<std::uint16_t> more(frame_.size(), kUntouched);
    const std::int64_t pixels =
        decoder_.decode_region(jpeg_, layout_, added.to_decode(), plain_table(), more, "x");
    added.copy_held(frame_, more);
    frame_ = more;
    held_ = added.together();
    return pixels;
  }

  /// Checks what JpegDecoder::decode_region guarantees, for all MCUs that were added.
  void expect_as_decoded_at_once() const {
    for (int y = 0; y < layout_.height; ++y) {
      for (int x = 0; x < layout_.width; ++x) {
        const auto pixel = static_cast<std::size_t>(y * layout_.width + x);
        if (!is_held(x, y)) {
          ASSERT_EQ(frame_[4 * pixel], kUntouched) << x << ", " << y;
          continue;
        }
        ASSERT_EQ(frame_[4 * pixel + 3], 65535) << x << ", " << y;
        if (!is_promised(x, y)) continue;
        for (std::size_t c = 0; c < 3; ++c) {
          ASSERT_EQ(frame_[4 * pixel + c], whole_.values[3 * pixel + c] * 257)
              << x << ", " << y << " channel " << c;
        }
      }
    }
  }

 private:
  bool is_held(int x, int y) const {
    if (x < 0 || y < 0 || x >= layout_.width || y >= layout_.height) return true;
    const int mcu = y / layout_.mcu_height * layout_.mcus_per_row + x / layout_.mcu_width;
    return held_[mcu] != 0;
  }
  bool is_promised(int x, int y) const {
    return is_held(x - 1, y - 1) && is_held(x, y - 1) && is_held(x + 1, y - 1) &&
           is_held(x - 1, y) && is_held(x + 1, y) && is_held(x - 1, y + 1) && is_held(x, y + 1) &&
           is_held(x + 1, y + 1);
  }

  JpegDecoder decoder_;
  std::vector<std::byte> jpeg_;
  JpegLayout layout_;
  RgbImage whole_;
  std::vector<std::uint16_t> frame_;
  McuMask held_;
};

McuMask rectangle(const JpegLayout& layout, int left, int top, int right, int bottom) {
  McuMask wanted(static_cast<std::size_t>(layout.mcu_count()));
  for (int row = top; row < bottom; ++row) {
    for (int column = left; column < right; ++column) {
      wanted[row * layout.mcus_per_row + column] = 1;
    }
  }
  return wanted;
}

TEST(IncrementalDecode, ShowWhatDecodingAllAtOnceShows) {
  std::mt19937 random(3);
  const auto below = [&](int end) {
    return static_cast<int>(random() % static_cast<unsigned>(end));
  };
  for (const Chroma chroma : {Chroma::k444, Chroma::k422, Chroma::k420}) {
    for (int round = 0; round < 6; ++round) {
      SCOPED_TRACE("chroma " + std::to_string(static_cast<int>(chroma)) + " round " +
                   std::to_string(round));
      Picture picture(chroma, 203, 117);
      const JpegLayout& layout = picture.layout();
      for (int part = 0; part < 6; ++part) {
        const int left = below(layout.mcus_per_row), top = below(layout.mcu_rows);
        const int wide = std::min(layout.mcus_per_row - left, 4);
        const int high = std::min(layout.mcu_rows - top, 4);
        picture.add(rectangle(layout, left, top, left + 1 + below(wide), top + 1 + below(high)));
        picture.expect_as_decoded_at_once();
        if (HasFatalFailure()) return;
      }
    }
  }
}

/// With 4:2:0, one row of MCUs is decoded twice at every border; with 4:4:4, none.
TEST(IncrementalDecode, OfBandsCostLittleMoreThanAllOfThem) {
  constexpr int kBands = 5;
  for (const Chroma chroma : {Chroma::k444, Chroma::k420}) {
    Picture picture(chroma, 640, 480);
    const JpegLayout& layout = picture.layout();
    std::int64_t pixels = 0;
    for (int band = 0; band < kBands; ++band) {
      const int top = layout.mcu_rows * band / kBands, end = layout.mcu_rows * (band + 1) / kBands;
      // A band also wants the MCU row above it, which the previous band has decoded.
      pixels += picture.add(rectangle(layout, 0, std::max(top - 1, 0), layout.mcus_per_row, end));
    }
    picture.expect_as_decoded_at_once();
    const int twice = chroma == Chroma::k444 ? 0 : 16 * (kBands - 1);
    EXPECT_EQ(pixels, 640 * (480 + twice));
  }
}

}  // namespace
}  // namespace raystage::store
