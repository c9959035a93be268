// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <string_view>
#include <vector>

#include "store/jpeg/decode.h"

namespace raystage {

struct JpegEncodeSettings {
  int quality = 95;  ///< 1-100, libjpeg's scale
  enum class Chroma { k444, k422, k420 } chroma = Chroma::k444;
  /// MCUs between restart markers; -1: chosen by default_restart_interval(); 0: none.
  int restart_interval = -1;
  /// Progressive, with Huffman tables made for the picture: a tenth smaller, and twice the time.
  bool progressive = false;
};

/// MCUs that make segments 32 pixels wide, 16 in frames narrower than 640, a whole MCU at least:
/// fine enough that a camera's part of a view costs little more than itself (docs/formats/jpeg.md
/// has the bytes it takes). It need not divide the MCU row.
int default_restart_interval(int frame_width, int mcu_width);

/// Encodes 8-bit RGB once. Throws Error (bad input) for sizes outside 1-65500 or wrong settings.
std::vector<std::byte> encode_jpeg(const RgbImage& image, const JpegEncodeSettings& settings);

/// The same picture with restart markers every `restart_interval` MCUs (-1: the default): the
/// quantised coefficients are carried over untouched, so every pixel decodes to the same value. A
/// progressive file becomes baseline; Huffman tables are made anew for the picture. APPn and COM
/// markers are kept. Throws Error (bad input) for a damaged frame.
std::vector<std::byte> add_restart_markers(std::span<const std::byte> jpeg, int restart_interval,
                                           std::string_view name);

}  // namespace raystage
