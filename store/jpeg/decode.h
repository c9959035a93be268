// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <memory>
#include <span>
#include <string_view>
#include <vector>

#include "store/jpeg/layout.h"
#include "store/jpeg/rgb_image.h"

namespace raystage {

/// One byte per MCU in raster order, non-zero = wanted.
using McuMask = std::vector<std::uint8_t>;

/// Linear light of each 8-bit code per channel R, G, B; full scale 1 = 65535.
struct LinearTable {
  std::uint16_t code[3][256];
};

/// Decodes JPEG frames, whole or only the segments that hold wanted MCUs. One per thread: holds
/// libjpeg-turbo's state and scratch memory for reuse.
class JpegDecoder {
 public:
  JpegDecoder();
  ~JpegDecoder();
  JpegDecoder(JpegDecoder&&) noexcept;

  /// The reference: libjpeg-turbo's own full decode (accurate DCT, smooth chroma upsampling).
  /// Grey frames give R = G = B. Throws Error (bad input) for a damaged or truncated frame.
  RgbImage decode(std::span<const std::byte> jpeg, std::string_view name);

  /// Decodes what `wanted` asks for into `rgba_linear` (width * height * 4 uint16: R, G, B through
  /// `table`, then 65535) and leaves other pixels untouched. Codes before the table are equal to
  /// decode()'s in every wanted MCU whose neighbouring MCUs (8 around) are wanted too or lie
  /// outside the image, and in the pixels of every wanted MCU at least 2 away from an MCU not
  /// wanted. `layout` must be this file's. Each segment is decoded up to its last wanted MCU;
  /// without restart markers that is the scan from its start, and where not layout.baseline_ycc
  /// the whole picture. Returns the pixels entropy-decoded, in whole MCUs. Throws Error (bad input)
  /// where what it decodes is damaged; damage elsewhere goes unnoticed.
  std::int64_t decode_region(std::span<const std::byte> jpeg, const JpegLayout& layout,
                             const McuMask& wanted, const LinearTable& table,
                             std::span<std::uint16_t> rgba_linear, std::string_view name);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage
