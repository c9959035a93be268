// SPDX-License-Identifier: Apache-2.0
// Converts a decoded frame to the luma image that depths are estimated on: luma in 8-bit codes of
// the sRGB curve, resampled without lens distortion. It is then packed with its three neighbours
// per 32-bit word. Cost: O(pixels). Reference: Picture in camera_depths_reference.cpp.
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

std::vector<std::uint8_t> luma_of(const store::DecodedFrame& frame, store::BlendSpace space) {
  const std::vector<float> code = code_table(space);
  std::vector<std::uint8_t> luma(static_cast<std::size_t>(frame.width) * frame.height);
  for (std::size_t i = 0; i < luma.size(); ++i) {
    const std::uint16_t* p = frame.rgba.get() + 4 * i;
    const float y =
        0.299F * code[p[0] >> 4U] + 0.587F * code[p[1] >> 4U] + 0.114F * code[p[2] >> 4U];
    luma[i] = static_cast<std::uint8_t>(std::max(1.0F, y + 0.5F));
  }
  return luma;
}

/// Returns the frame's luma at the pinhole's pixels, 0 where the frame does not show them.
std::vector<std::uint8_t> without_distortion(const std::vector<std::uint8_t>& luma,
                                             const rig::CameraModel& model,
                                             const VirtualCamera& pinhole) {
  std::vector<std::uint8_t> straight(static_cast<std::size_t>(pinhole.width) * pinhole.height);
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
      const auto at = [&](int column, int row) {
        return static_cast<double>(
            luma[static_cast<std::size_t>(std::min(row, model.height() - 1)) * model.width() +
                 static_cast<std::size_t>(std::min(column, model.width() - 1))]);
      };
      const double right = u - left, down = v - top;
      const double upper = at(left, top) * (1 - right) + at(left + 1, top) * right;
      const double lower = at(left, top + 1) * (1 - right) + at(left + 1, top + 1) * right;
      straight[static_cast<std::size_t>(y) * pinhole.width + x] =
          static_cast<std::uint8_t>(upper + down * (lower - upper) + 0.5);
    }
  });
  return straight;
}

}  // namespace

MatchingImage::MatchingImage(const store::DecodedFrame& frame, store::BlendSpace space,
                             const rig::Rig::Camera& camera, const VirtualCamera& pinhole)
    : width_(pinhole.width), height_(pinhole.height) {
  std::vector<std::uint8_t> luma = luma_of(frame, space);
  if (camera.model.has_distortion()) luma = without_distortion(luma, camera.model, pinhole);
  words_.resize(luma.size());
  const auto width = static_cast<std::size_t>(width_);
  for (std::size_t y = 0; y < static_cast<std::size_t>(height_); ++y) {
    const std::size_t below = y + 1 < static_cast<std::size_t>(height_) ? width : 0;
    for (std::size_t x = 0; x < width; ++x) {
      const std::size_t at = y * width + x, right = x + 1 < width ? 1 : 0;
      const std::array<std::uint32_t, 4> four{luma[at], luma[at + right], luma[at + below],
                                              luma[at + below + right]};
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
