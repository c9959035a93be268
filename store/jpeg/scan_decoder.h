// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <string_view>
#include <vector>

#include "store/jpeg/inverse_dct.h"
#include "store/jpeg/layout.h"
#include "store/jpeg/tables.h"

namespace raystage::store {

/// The samples of one component, in whole MCUs.
struct Plane {
  static constexpr std::size_t kPadding = 128;  ///< bytes that may be read beyond the last sample

  std::size_t stride = 0;     ///< bytes from row to row
  int width = 0, height = 0;  ///< of the component's true samples: T.81 A.1.1's x_i, y_i
  std::vector<std::uint8_t> samples;

  std::uint8_t* at(std::size_t x, std::size_t y) { return samples.data() + y * stride + x; }
  const std::uint8_t* row(int y) const {
    return samples.data() + static_cast<std::size_t>(y) * stride;
  }
};

/// Decodes chosen MCUs of baseline scans (entropy decoding and inverse DCT). Keeps its memory
/// between frames, and the tables while headers are equal.
class ScanDecoder {
 public:
  /// Decodes the segments that hold MCUs with wanted[i] != 0, each up to its last such MCU, and
  /// writes only wanted MCUs to the planes. The layout must be baseline_ycc and of this file.
  /// Returns the number of entropy-decoded MCUs. Throws Error (bad input) if the data are damaged.
  std::int64_t decode(std::span<const std::byte> jpeg, const JpegLayout& layout,
                      std::span<const std::uint8_t> wanted, std::string_view name);

  const Plane& plane(int component) const { return planes_[component]; }

 private:
  struct Segment {
    int first_mcu = 0, end_mcu = 0;  ///< to decode
    bool whole = false;              ///< the segment ends at end_mcu
    std::size_t begin = 0, end = 0;  ///< bytes of the file
  };

  void prepare(std::span<const std::byte> jpeg, const JpegLayout& layout, std::string_view name);
  void decode_segment(std::span<const std::byte> jpeg, const JpegLayout& layout,
                      const Segment& segment, std::span<const std::uint8_t> wanted,
                      std::string_view name);
  std::span<const std::uint8_t> unstuff(std::span<const std::byte> bytes);

  ScanTables tables_;
  std::vector<std::byte> header_;  ///< of the file from which tables_ were read
  std::vector<std::uint8_t> bits_;
  BlockPair pair_;
  int pending_ = 0;     ///< blocks in pair_
  bool clean_ = false;  ///< pair_'s coefficients are all zero
  Plane planes_[3];
};

}  // namespace raystage::store
