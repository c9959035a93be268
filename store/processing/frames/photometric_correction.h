// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <memory>
#include <span>
#include <vector>

#include "rig/photometric_model.h"
#include "schemas/pixel_encoding.h"
#include "schemas/take_document.h"
#include "store/jpeg/decode.h"
#include "store/jpeg/layout.h"
#include "store/jpegxl/deep_picture.h"
#include "store/processing/frames/frame_matte.h"

namespace raystage::store {

/// Returns the linear light of the brightest pixel that a camera can record, over all channels.
double max_linear_light(const schemas::PhotometricResponse& response, rig::PictureSize size,
                        const schemas::TakeDocument& take);

/// The same of a camera whose frames have more than 8 bits: `encoding.peak` passed through the
/// correction.
double max_linear_light(const schemas::PhotometricResponse& response, rig::PictureSize size,
                        const schemas::PixelEncoding& encoding);

/// Levels, 0 to 65535, of light at 65536 equal steps of its square root, which resolves dark tones
/// as finely as the eye; for full scale 1. Cameras share one table.
using LevelTable = std::shared_ptr<const std::vector<std::uint16_t>>;
LevelTable make_level_table(BlendSpace space);

/// Returns whether the correction depends on the pixel's position or on several channels, so that a
/// table of codes is not enough.
bool needs_per_pixel_correction(const schemas::PhotometricResponse& response);

/// Converts a camera's codes to light (PhotometricResponse) during decoding. Curve, contrast and
/// brightness need only a table, at no extra cost. Otherwise the table keeps the codes, and a
/// second pass corrects every pixel.
class PhotometricCorrection {
 public:
  /// Prepares the tables. `levels`: the table of scale.space; null: computed here if it is needed.
  PhotometricCorrection(const schemas::PhotometricResponse& response, rig::PictureSize size,
                        const schemas::TakeDocument& take, const CodeScale& scale,
                        LevelTable levels = nullptr);

  /// For frames of more than 8 bits: prepares tables of samples, for convert(). The curve of the
  /// response is one of sRGB codes; above white it is a straight line.
  PhotometricCorrection(const schemas::PhotometricResponse& response, rig::PictureSize size,
                        const schemas::PixelEncoding& encoding, const CodeScale& scale,
                        LevelTable levels = nullptr);

  /// Returns the table for JpegDecoder::decode_region.
  const LinearTable& table() const { return table_; }
  bool is_table_only() const { return !pixels_; }

  /// Converts the pixels of the `wanted` MCUs, decoded with table(), to light in place. The result
  /// depends only on the pixel's own MCU. `rgba`: 4 values per pixel of the whole frame.
  void correct(std::span<std::uint16_t> rgba, const JpegLayout& layout,
               const McuMask& wanted) const;

  /// Converts a picture of more than 8 bits to light, whole. `rgba`: R, G, B, 65535 per pixel.
  void convert(const DeepPicture& picture, std::span<std::uint16_t> rgba) const;

  /// Returns the light of a sample, full scale 1, before gain and matrix; 0 or more unless the
  /// sample is negative. Of a response with a table only, this is what its table holds.
  static double light_of_sample(const schemas::PhotometricResponse& response,
                                const schemas::PixelEncoding& encoding, std::size_t channel,
                                std::uint16_t sample);

  /// Returns the levels of `code` at pixel (x, y), R, G, B: the slow reference for correct(),
  /// except for hot pixels that are replaced by their neighbours.
  static std::array<std::uint16_t, 3> reference(const schemas::PhotometricResponse& response,
                                                rig::PictureSize size,
                                                const schemas::TakeDocument& take,
                                                const CodeScale& scale, int x, int y,
                                                const std::array<std::uint8_t, 3>& code);
  /// The same of samples of more than 8 bits.
  static std::array<std::uint16_t, 3> reference(const schemas::PhotometricResponse& response,
                                                rig::PictureSize size,
                                                const schemas::PixelEncoding& encoding,
                                                const CodeScale& scale, int x, int y,
                                                const std::array<std::uint16_t, 3>& sample);

 private:
  class Gains;
  class Pixels;
  LinearTable table_{};
  /// Levels of samples of more than 8 bits, R, G, B one after the other; null: there is none.
  std::shared_ptr<const std::vector<std::uint16_t>> deep_table_;
  std::shared_ptr<const Pixels> pixels_;
};

}  // namespace raystage::store
