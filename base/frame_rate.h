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

/// The ratio that a decimal number stands for. 23.976, 23.98, 29.97 and 59.94 stand for
/// n * 1000/1001, as everywhere in film and television; other numbers for themselves, up to six
/// decimals. Nothing outside (0, 1000] or with more decimals.
std::optional<FrameRate> frame_rate_from(double fps);

/// "24000/1001". Nothing for a text of another form or a rate outside (0, 1000].
std::optional<FrameRate> frame_rate_from(std::string_view ratio);

}  // namespace raystage
