// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <optional>

namespace raystage::schemas {

/// The meaning of the samples of a camera whose frames are JPEG XL pictures of more than 8 bits.
struct PixelEncoding {
  enum class Samples : std::uint8_t {
    kHalf,    ///< IEEE 754 binary16
    kInteger  ///< of which the largest, 2^bits - 1, stands for 1
  };
  enum class Transfer : std::uint8_t {
    kLinear,  ///< samples are light
    kSrgb,    ///< IEC 61966-2-1
    kPq,      ///< ITU-R BT.2100; white is 203 cd/m2 (BT.2408)
    kHlg      ///< ITU-R BT.2100, scene light; white is at 75 % (BT.2408)
  };
  static constexpr int kMinBits = 9, kMaxBits = 16;

  Samples samples = Samples::kHalf;
  int bits = kMaxBits;  ///< kMinBits to kMaxBits; 16 of half floats
  Transfer transfer = Transfer::kLinear;
  /// CIE x, y of red, green, blue and white; nullopt: Rec.709.
  std::optional<std::array<double, 8>> chromaticities = {};
  /// Linear light of the brightest sample, white = 1. Brighter samples count as this one.
  double peak = 1;
  bool operator==(const PixelEncoding&) const = default;

  int largest_code() const { return (1 << bits) - 1; }  ///< of integers
};

}  // namespace raystage::schemas
