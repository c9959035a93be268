// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "store/jpeg/decode.h"
#include "store/jpeg/layout.h"

namespace raystage {

/// How a frame that is decoded in part comes to hold more. It then holds what
/// JpegDecoder::decode_region promises of all its MCUs together, as if they had been decoded at
/// once, for little more than the cost of those that are new.
class AddedMcus {
 public:
  /// Masks of `layout`'s size, which must be of a frame whose regions are decodable. Keeps a
  /// reference to `layout`.
  AddedMcus(const JpegLayout& layout, const McuMask& held, const McuMask& wanted);

  /// All that the frame will hold.
  const McuMask& together() const { return together_; }
  /// The new ones, and of those held what is beside them: chroma reaches across their border.
  const McuMask& to_decode() const { return to_decode_; }
  /// Puts what is held and stays as it is into a frame that to_decode() was decoded into. Both:
  /// 4 values per pixel, rows without padding.
  void copy_held(std::span<const std::uint16_t> held, std::span<std::uint16_t> frame) const;

 private:
  bool is_new(int column, int row) const;

  const JpegLayout& layout_;
  McuMask new_, together_, to_decode_;
};

}  // namespace raystage
