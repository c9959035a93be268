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

namespace raystage::store {

/// One byte per MCU in raster order, non-zero = wanted.
using McuMask = std::vector<std::uint8_t>;

/// The linear light of each 8-bit code, per channel R, G, B; 65535 stands for 1.
struct LinearTable {
  std::uint16_t code[3][256];
};

/// Decodes JPEG frames, whole or only the segments with wanted MCUs. Use one per thread: it reuses
/// libjpeg-turbo's state and scratch memory.
class JpegDecoder {
 public:
  JpegDecoder();
  ~JpegDecoder();
  JpegDecoder(JpegDecoder&&) noexcept;

  /// Returns the whole picture: the reference, libjpeg-turbo's full decode (accurate DCT, smooth
  /// chroma upsampling). Grey frames give R = G = B. Throws Error (bad input) if the frame is
  /// damaged or truncated.
  RgbImage decode(std::span<const std::byte> jpeg, std::string_view name);

  /// Returns the picture at an 8th, 4th or half of its size, rounded up (`divisor` 8, 4 or 2), or
  /// whole (1), by libjpeg-turbo's scaled inverse DCT: for small pictures, at less than the cost of
  /// a whole one. Throws as decode().
  RgbImage decode_scaled(std::span<const std::byte> jpeg, int divisor, std::string_view name);

  /// Decodes the MCUs that `wanted` marks into `rgba_linear` and leaves other pixels untouched.
  /// `rgba_linear` has width * height * 4 uint16: R, G, B through `table`, then 65535. `layout`
  /// must be that of this file.
  /// Codes before the table equal decode()'s in every wanted MCU whose 8 neighbouring MCUs are
  /// wanted too or outside of the image. In other wanted MCUs they do in pixels at least 2 away
  /// from an MCU not wanted.
  /// Each segment is decoded up to its last wanted MCU. Without restart markers that is the scan
  /// from its start; without layout.baseline_ycc it is the whole picture. Returns the number of
  /// entropy-decoded pixels, in whole MCUs. Throws Error (bad input) if a decoded part is damaged;
  /// damage elsewhere is not detected.
  std::int64_t decode_region(std::span<const std::byte> jpeg, const JpegLayout& layout,
                             const McuMask& wanted, const LinearTable& table,
                             std::span<std::uint16_t> rgba_linear, std::string_view name);

 private:
  struct State;
  std::unique_ptr<State> state_;
};

}  // namespace raystage::store
