// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string_view>

namespace raystage {

/// Frames per second as an exact ratio, both parts positive.
struct FrameRate {
  int numerator = 24, denominator = 1;
  double fps() const { return static_cast<double>(numerator) / denominator; }
  bool operator==(const FrameRate&) const = default;
};

/// Returns the exact ratio of a rate in frames per second. 23.976, 23.98, 29.97 and 59.94 mean
/// n * 1000/1001, as usual in film and television. Other rates are taken literally, up to six
/// decimals. Returns nullopt outside (0, 1000] or for more decimals.
std::optional<FrameRate> frame_rate_from(double fps);

/// Parses a ratio such as "24000/1001". Returns nullopt for any other text or a rate outside
/// (0, 1000].
std::optional<FrameRate> frame_rate_from(std::string_view ratio);

}  // namespace raystage
