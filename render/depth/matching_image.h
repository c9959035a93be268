// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <vector>

#include "render/depth/estimation_regions.h"
#include "render/depth/inverse_depth_map.h"
#include "store/processing/frames/frame_cache.h"

namespace raystage::render {

/// A frame for depth estimation: luma without lens distortion, in 8-bit codes of the sRGB curve, 1
/// to 255 (black is 1). A pixel is a 32-bit word: its luma (lowest byte) and that of its right,
/// lower and lower right neighbours, so a bilinear sample reads one word. A word is 0 (unknown) if
/// the frame does not show one of the four: outside its border, or where its lens model is invalid.
class MatchingImage {
 public:
  MatchingImage() = default;
  /// Converts a frame. `pinhole`: undistorted() of the camera.
  MatchingImage(const store::DecodedFrame& frame, const store::CodeScale& scale,
                const rig::Rig::Camera& camera, const VirtualCamera& pinhole);

  /// Returns a part of the image. Pixels at its right and lower border keep their neighbours.
  MatchingImage cropped(const PixelRectangle& part) const;

  int width() const { return width_; }
  int height() const { return height_; }
  const std::uint32_t* words() const { return words_.data(); }
  /// Returns 0 if the luma is unknown.
  std::uint8_t luma(int x, int y) const {
    return static_cast<std::uint8_t>(words_[static_cast<std::size_t>(y) * width_ + x]);
  }
  bool is_known(int x, int y) const { return luma(x, y) != 0; }
  /// Returns the differences of blue and red from luma, halved, around 128: codes.
  std::array<std::uint8_t, 2> chroma(int x, int y) const {
    return chroma_[static_cast<std::size_t>(y) * width_ + x];
  }
  std::vector<std::uint8_t> plane() const;  ///< returns all luma, row-major

 private:
  int width_ = 0, height_ = 0;
  std::vector<std::uint32_t> words_;
  std::vector<std::array<std::uint8_t, 2>> chroma_;
};

}  // namespace raystage::render
