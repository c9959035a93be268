// SPDX-License-Identifier: Apache-2.0
// Converts a decoded frame to the luma image that depths are estimated on: luma in 8-bit codes of
// the sRGB curve, resampled without lens distortion. It is then packed with its three neighbours
// per 32-bit word. Chroma is kept for comparisons of colours. Cost: O(pixels). Reference: Picture
// in camera_depths_reference.cpp.
#include "render/depth/matching_image.h"

#include <algorithm>
#include <array>

#include "base/parallel.h"
#include "base/transfer_function.h"

namespace raystage::render {
namespace {

/// Returns 8-bit codes of sRGB's curve for the upper 12 bits of a frame's codes.
std::vector<float> code_table(store::BlendSpace space) {
  constexpr int kEntries = 4096;
  std::vector<float> table(kEntries);
  for (int i = 0; i < kEntries; ++i) {
    const double code = i / (kEntries - 1.0);
    table[i] = static_cast<float>(
        255 * (space == store::BlendSpace::kLinear ? srgb_from_linear(code) : code));
  }
  return table;
}

/// Luma, and the differences of blue and red from it, halved, around 128: 8-bit codes.
using LumaChroma = std::array<std::uint8_t, 3>;

std::vector<LumaChroma> luma_chroma_of(const store::DecodedFrame& frame, store::BlendSpace space) {
  const std::vector<float> code = code_table(space);
  std::vector<LumaChroma> pixels(static_cast<std::size_t>(frame.width) * frame.height);
  for (std::size_t i = 0; i < pixels.size(); ++i) {
    const std::uint16_t* p = frame.rgba.get() + 4 * i;
    const float red = code[p[0] >> 4U], green = code[p[1] >> 4U], blue = code[p[2] >> 4U];
    const float y = 0.299F * red + 0.587F * green + 0.114F * blue;
    const auto chroma = [y](float channel) {
      return static_cast<std::uint8_t>(std::clamp((channel - y) / 2 + 128.5F, 0.0F, 255.0F));
    };
    pixels[i] = {static_cast<std::uint8_t>(std::max(1.0F, y + 0.5F)), chroma(blue), chroma(red)};
  }
  return pixels;
}

/// Returns the frame's values at the pinhole's pixels, 0 where the frame does not show them.
std::vector<LumaChroma> without_distortion(const std::vector<LumaChroma>& pixels,
                                           const rig::CameraModel& model,
                                           const VirtualCamera& pinhole) {
  std::vector<LumaChroma> straight(static_cast<std::size_t>(pinhole.width) * pinhole.height);
  const schemas::Intrinsics& k = pinhole.intrinsics;
  raystage::parallel_for(0, pinhole.height, [&](int y) {
    for (int x = 0; x < pinhole.width; ++x) {
      const auto pixel = model.pixel_from_ideal({(x + 0.5 - k.cx) / k.fx, (y + 0.5 - k.cy) / k.fy});
      const bool is_shown = pixel && pixel->x() >= 0 && pixel->y() >= 0 &&
                            pixel->x() <= model.width() && pixel->y() <= model.height();
      if (!is_shown) continue;
      const double u = std::clamp(pixel->x() - 0.5, 0.0, model.width() - 1.0);
      const double v = std::clamp(pixel->y() - 0.5, 0.0, model.height() - 1.0);
      const int left = static_cast<int>(u), top = static_cast<int>(v);
      const auto at = [&](int column, int row) -> const LumaChroma& {
        return pixels[static_cast<std::size_t>(std::min(row, model.height() - 1)) * model.width() +
                      static_cast<std::size_t>(std::min(column, model.width() - 1))];
      };
      const LumaChroma &a = at(left, top), &b = at(left + 1, top), &c = at(left, top + 1),
                       &d = at(left + 1, top + 1);
      const double right = u - left, down = v - top;
      LumaChroma& result = straight[static_cast<std::size_t>(y) * pinhole.width + x];
      for (std::size_t i = 0; i < result.size(); ++i) {
        const double upper = a[i] * (1 - right) + b[i] * right;
        const double lower = c[i] * (1 - right) + d[i] * right;
        result[i] = static_cast<std::uint8_t>(upper + down * (lower - upper) + 0.5);
      }
    }
  });
  return straight;
}

}  // namespace

MatchingImage::MatchingImage(const store::DecodedFrame& frame, store::BlendSpace space,
                             const rig::Rig::Camera& camera, const VirtualCamera& pinhole)
    : width_(pinhole.width), height_(pinhole.height) {
  std::vector<LumaChroma> pixels = luma_chroma_of(frame, space);
  const bool is_whole = pinhole.width == frame.width && pinhole.height == frame.height;
  if (camera.model.has_distortion() || !is_whole) {
    pixels = without_distortion(pixels, camera.model, pinhole);
  }
  words_.resize(pixels.size());
  chroma_.resize(pixels.size());
  for (std::size_t i = 0; i < pixels.size(); ++i) chroma_[i] = {pixels[i][1], pixels[i][2]};
  const auto width = static_cast<std::size_t>(width_);
  for (std::size_t y = 0; y < static_cast<std::size_t>(height_); ++y) {
    const std::size_t below = y + 1 < static_cast<std::size_t>(height_) ? width : 0;
    for (std::size_t x = 0; x < width; ++x) {
      const std::size_t at = y * width + x, right = x + 1 < width ? 1 : 0;
      const std::array<std::uint32_t, 4> four{pixels[at][0], pixels[at + right][0],
                                              pixels[at + below][0], pixels[at + below + right][0]};
      if (std::ranges::find(four, 0U) != four.end()) continue;
      words_[at] = four[0] | four[1] << 8U | four[2] << 16U | four[3] << 24U;
    }
  }
}

std::vector<std::uint8_t> MatchingImage::plane() const {
  std::vector<std::uint8_t> luma(words_.size());
  std::ranges::transform(words_, luma.begin(),
                         [](std::uint32_t word) { return static_cast<std::uint8_t>(word); });
  return luma;
}

}  // namespace raystage::render
