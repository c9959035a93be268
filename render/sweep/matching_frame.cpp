// SPDX-License-Identifier: Apache-2.0
#include <algorithm>

#include "render/matching/matching.h"
#include "render/sweep/cost_kernels.h"
#include "schemas/transfer_function.h"

namespace raystage {
namespace {

std::vector<std::uint8_t> srgb_of_linear_codes() {
  std::vector<std::uint8_t> table(65536);
  for (std::size_t code = 0; code < table.size(); ++code) {
    table[code] =
        static_cast<std::uint8_t>(srgb_from_linear(static_cast<double>(code) / 65535) * 255 + 0.5);
  }
  return table;
}

}  // namespace

std::size_t MatchingFrame::bytes(int width, int height) {
  return (static_cast<std::size_t>(width) + 1) * (static_cast<std::size_t>(height) + 1) *
         sizeof(std::uint32_t);
}

MatchingFrame::MatchingFrame(const DecodedFrame& frame, BlendSpace space)
    : pitch_(frame.width + 1) {
  pixels_.reserve(bytes(frame.width, frame.height) / sizeof(std::uint32_t));
  const auto append_row = [&](int y, const auto& code) {
    const std::uint16_t* from =
        frame.rgbx.get() + static_cast<std::size_t>(y) * static_cast<std::size_t>(frame.width) * 4;
    for (int x = 0; x < frame.width; ++x, from += 4) {
      pixels_.push_back(code(from[0]) | code(from[1]) << 8U | code(from[2]) << 16U | 0xFF000000U);
    }
    pixels_.push_back(pixels_.back());
  };
  const auto append_rows = [&](const auto& code) {
    for (int y = 0; y < frame.height; ++y) append_row(y, code);
    append_row(frame.height - 1, code);
  };
  if (space == BlendSpace::kPerceptual) {
    append_rows([](std::uint16_t code) { return static_cast<std::uint32_t>(code >> 8U); });
  } else {
    const std::vector<std::uint8_t> table = srgb_of_linear_codes();
    append_rows([&](std::uint16_t code) { return static_cast<std::uint32_t>(table[code]); });
  }
}

CostScratch::CostScratch(int planes)
    : stride_(static_cast<std::size_t>(plane_stride(planes))),
      samples_(3 * kMostMatched * stride_),
      right_(stride_),
      down_(stride_),
      upper_(2 * stride_),
      lower_(2 * stride_),
      offsets_(stride_) {}

CostScratch::Camera CostScratch::camera(int i) {
  std::uint32_t* first = samples_.data() + 3 * static_cast<std::size_t>(i) * stride_;
  return {first, first + stride_, first + 2 * stride_};
}

}  // namespace raystage
