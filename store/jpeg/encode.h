// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "store/jpeg/decode.h"

namespace raystage::store {

struct JpegEncodeOptions {
  int quality = 95;  ///< 1-100, libjpeg's scale
  enum class Chroma { k444, k422, k420 } chroma = Chroma::k444;
  /// MCUs between restart markers; -1: default_restart_interval(); 0: none.
  int restart_interval = -1;
  /// Progressive, with Huffman tables optimised for the picture: a tenth smaller, twice the time.
  bool progressive = false;
  bool is_valid(std::string* reason) const;
};

/// Returns the MCUs per segment for segments 32 pixels wide (16 in frames narrower than 640), at
/// least one whole MCU. With these, decoding a part of a frame costs little more than the part
/// (docs/formats/jpeg.md has the cost in bytes). It need not divide the MCU row.
int default_restart_interval(int frame_width, int mcu_width);

/// Returns a picture as JPEG. Throws Error (bad input) for sizes outside 1-65500 or invalid
/// settings.
std::vector<std::byte> encode_jpeg(const RgbImage& image, const JpegEncodeOptions& options);

/// Returns the same picture with restart markers every `restart_interval` MCUs (-1: the default).
/// Quantised coefficients are unchanged, so every pixel decodes to the same value. A progressive
/// file becomes baseline; Huffman tables are optimised for the picture. APPn and COM markers are
/// kept. Throws Error (bad input) if the frame is damaged.
std::vector<std::byte> add_restart_markers(std::span<const std::byte> jpeg, int restart_interval,
                                           std::string_view name);

}  // namespace raystage::store
