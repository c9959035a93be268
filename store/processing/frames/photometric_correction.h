// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "rig/photometric_model.h"
#include "schemas/take_document.h"
#include "store/jpeg/decode.h"
#include "store/jpeg/layout.h"
#include "store/processing/frames/frame_matte.h"

namespace raystage {

/// Light of the brightest pixel that a camera can show, of any channel.
double brightest_light(const PhotometricResponse& response, PictureSize size,
                       const TakeDocument& take);

/// Levels, 0 to 65535, of light in 65536 steps of its root, so that they are as fine in the dark as
/// the eye's; for a full scale of 1. Cameras share one.
using LevelTable = std::shared_ptr<const std::vector<std::uint16_t>>;
LevelTable make_level_table(BlendSpace space);

/// Whether a table by code alone is not enough.
bool needs_pixels(const PhotometricResponse& response);

/// Turns a camera's codes into light (PhotometricResponse) while they are decoded: by a table alone
/// where curve, contrast and brightness are all there is, which costs nothing; otherwise by a table
/// that holds the codes and one more look at every pixel.
class PhotometricCorrection {
 public:
  /// `levels`: of scale.space; null: makes its own where it needs one.
  PhotometricCorrection(const PhotometricResponse& response, PictureSize size,
                        const TakeDocument& take, const CodeScale& scale,
                        LevelTable levels = nullptr);

  /// What JpegDecoder::decode_region looks codes up in.
  const LinearTable& table() const { return table_; }
  bool is_table_alone() const { return !pixels_; }

  /// Turns the pixels of the wanted MCUs, codes by table() as yet, into light, in place. What a
  /// pixel becomes depends on its own MCU alone; 4 values a pixel of the whole picture.
  void correct(std::span<std::uint16_t> rgba, const JpegLayout& layout,
               const McuMask& wanted) const;

  /// The slow reference: what `code` at pixel (x, y) becomes, where it is not shown as its
  /// neighbours are.
  static std::array<std::uint16_t, 3> reference(const PhotometricResponse& response,
                                                PictureSize size, const TakeDocument& take,
                                                const CodeScale& scale, int x, int y,
                                                const std::array<std::uint8_t, 3>& code);

 private:
  class Gains;
  class Pixels;
  LinearTable table_{};
  std::shared_ptr<const Pixels> pixels_;
};

}  // namespace raystage
