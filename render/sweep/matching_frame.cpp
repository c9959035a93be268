// SPDX-License-Identifier: Apache-2.0
// Converts the matched part of a decoded frame to words that cost_kernels.cpp reads: 8-bit codes of
// the sRGB curve, packed with their right, lower and lower right neighbours. Input: 16-bit R, G, B,
// A. Output: 3 words of 32 bits per pixel of the box, channel by channel within a row. Cost:
// O(pixels of the box).
#include "render/sweep/matching_frame.h"

#include <algorithm>
#include <array>
#include <vector>

#include "base/transfer_function.h"
#include "store/processing/frames/matching_code.h"

namespace raystage::render {
namespace {

constexpr std::size_t kChannels = 3;
constexpr std::size_t kReadBeyond = 32;  // words

std::vector<std::uint8_t> srgb_of_codes(const store::CodeScale& scale) {
  std::vector<std::uint8_t> table(65536);
  for (std::size_t code = 0; code < table.size(); ++code) {
    const double part = store::part_from_value(scale.space, static_cast<double>(code) / 65535);
    const double shown = scale.space == store::BlendSpace::kHighRange
                             ? store::matching_code(scale, part * scale.full_scale)
                             : srgb_from_linear(part);
    table[code] = static_cast<std::uint8_t>(shown * 255 + 0.5);
  }
  return table;
}

/// The codes of a row by channel, one pixel wider than the box.
using CodeRow = std::array<std::vector<std::uint8_t>, kChannels>;

class CodeRows {
 public:
  CodeRows(const store::DecodedFrame& frame, const store::CodeScale& scale, const FrameBox& box)
      : frame_(frame), box_(box) {
    if (scale.space != store::BlendSpace::kPerceptual) table_ = srgb_of_codes(scale);
  }

  void read(int y, CodeRow& row) const {
    const std::uint16_t* first =
        frame_.rgba.get() +
        (static_cast<std::size_t>(std::min(y, frame_.height - 1)) * frame_.width + box_.left) * 4;
    const auto width = static_cast<std::size_t>(box_.right - box_.left);
    const std::size_t within = width + (box_.right < frame_.width ? 1 : 0);
    for (std::size_t c = 0; c < kChannels; ++c) {
      row[c].resize(width + 1);
      std::uint8_t* codes = row[c].data();
      if (table_.empty()) {
        for (std::size_t x = 0; x < within; ++x) {
          codes[x] = static_cast<std::uint8_t>(first[4 * x + c] >> 8U);
        }
      } else {
        for (std::size_t x = 0; x < within; ++x) codes[x] = table_[first[4 * x + c]];
      }
      if (within == width) codes[width] = codes[width - 1];
    }
  }

 private:
  const store::DecodedFrame& frame_;
  const FrameBox& box_;
  std::vector<std::uint8_t> table_;
};

void write_words(const std::vector<std::uint8_t>& upper, const std::vector<std::uint8_t>& lower,
                 std::size_t width, std::uint32_t* words) {
  const std::uint8_t *above = upper.data(), *below = lower.data();
  for (std::size_t x = 0; x < width; ++x) {
    words[x] = static_cast<std::uint32_t>(above[x]) |
               static_cast<std::uint32_t>(above[x + 1]) << 8U |
               static_cast<std::uint32_t>(below[x]) << 16U |
               static_cast<std::uint32_t>(below[x + 1]) << 24U;
  }
}

std::size_t words_of(const FrameBox& box) {
  return kChannels * (box.right - box.left) * (box.bottom - box.top) + kReadBeyond;
}

}  // namespace

std::size_t MatchingFrame::bytes(const FrameBox& box) {
  return LargeBuffer<std::uint32_t>::bytes(words_of(box));
}

MatchingFrame::MatchingFrame(const store::DecodedFrame& frame, const store::CodeScale& scale,
                             const FrameBox& box)
    : box_(box), words_(words_of(box)) {
  const CodeRows rows(frame, scale, box_);
  const auto width = static_cast<std::size_t>(pitch());
  CodeRow upper, lower;
  rows.read(box.top, upper);
  std::uint32_t* words = words_.data();
  for (int y = box.top; y < box.bottom; ++y) {
    rows.read(y + 1, lower);
    for (std::size_t c = 0; c < kChannels; ++c, words += width) {
      write_words(upper[c], lower[c], width, words);
    }
    std::swap(upper, lower);
  }
}

}  // namespace raystage::render
