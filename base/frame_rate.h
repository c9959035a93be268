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

/// The rates that files may state, in frames per second. Their periods, 1 ns to 32 years, and
/// multiples of these by up to nine fit Nanoseconds.
inline constexpr double kMinRateInFiles = 1e-9, kMaxRateInFiles = 1e9;

/// Returns the exact ratio of a rate in frames per second, or nullopt outside (0, 1000] or for more
/// than six decimals. 23.976, 23.98, 29.97 and 59.94 mean n * 1000/1001, as in film and television.
std::optional<FrameRate> frame_rate_from(double fps);

/// Parses a ratio such as "24000/1001". Returns nullopt for other text or outside (0, 1000].
std::optional<FrameRate> frame_rate_from(std::string_view ratio);

}  // namespace raystage
