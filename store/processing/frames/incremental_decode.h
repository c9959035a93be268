// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "store/jpeg/decode.h"
#include "store/jpeg/layout.h"

namespace raystage::store {

/// Adds MCUs to a partly decoded frame. The result equals JpegDecoder::decode_region of all its
/// MCUs at once, at little more than the cost of the new ones.
class IncrementalDecode {
 public:
  /// Determines the MCUs to decode. `held`, `wanted`: one value per MCU of `layout`, whose regions
  /// must be decodable. Keeps a reference to `layout`.
  IncrementalDecode(const JpegLayout& layout, const McuMask& held, const McuMask& wanted);

  /// Returns all MCUs that the frame will contain.
  const McuMask& together() const { return together_; }
  /// Returns the new MCUs and the held ones next to them, because chroma upsampling crosses
  /// borders.
  const McuMask& to_decode() const { return to_decode_; }
  /// Copies the unchanged pixels of `held` into `frame`, in which the MCUs to decode are decoded
  /// already. Both: 4 values per pixel, rows without padding.
  void copy_held(std::span<const std::uint16_t> held, std::span<std::uint16_t> frame) const;

 private:
  bool is_new(int column, int row) const;

  const JpegLayout& layout_;
  McuMask new_, together_, to_decode_;
};

}  // namespace raystage::store
