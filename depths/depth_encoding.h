// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>

#include "render/depth/recorded_depths.h"
#include "schemas/geometry.h"

namespace raystage::depths {

/// What the values of a depth image mean.
struct DepthEncoding {
  render::DepthQuantity quantity = render::DepthQuantity::kPlanar;
  /// Metres of the value 1 of a float image, or of the code 1 of 16 bits. None: 1 m for floats.
  std::optional<double> unit_m;
  /// Codes of 16 bits are evenly spaced in inverse depth between far (code 0) and near (65535), as
  /// in MPEG immersive video: 1/d = code / 65535 (1/near - 1/far) + 1/far. far may be infinite.
  std::optional<schemas::DepthRange> inverse_range;
  std::string channel;  ///< of EXR files; empty: Z

  bool is_valid(std::string* reason) const;
};

/// Returns the encoding in words, for documents. `is_exr`: of EXR files, else of PNG files.
std::string describe(const DepthEncoding& encoding, bool is_exr);

inline constexpr int kMaxDepthCode = 65535;
/// Returns the inverse depth (1/m) of a code, or render::kUnknownDepth of code 0.
float inverse_depth_of_code(std::uint16_t code, const schemas::DepthRange& range);
/// Returns the nearest code, at least 1, or 0 of render::kUnknownDepth. Depths outside of the range
/// get its limits.
std::uint16_t code_of_inverse_depth(float inverse_depth, const schemas::DepthRange& range);

}  // namespace raystage::depths
