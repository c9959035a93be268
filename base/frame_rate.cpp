// SPDX-License-Identifier: Apache-2.0
#include "base/frame_rate.h"

#include <charconv>
#include <cmath>
#include <numeric>

namespace raystage {
namespace {

constexpr double kFastest = 1000;

}  // namespace

std::optional<FrameRate> frame_rate_from(double fps) {
  if (!(fps > 0 && fps <= kFastest)) return std::nullopt;
  for (const int nominal : {24, 30, 48, 60, 120}) {
    constexpr double kUsualRounding = 0.0045;  // accepts 23.98 as 23.976...
    if (std::abs(fps - nominal / 1.001) < kUsualRounding) return FrameRate{nominal * 1000, 1001};
  }
  for (int denominator = 1; denominator <= 1'000'000; denominator *= 10) {
    const double scaled = fps * denominator;
    const double rounded = std::round(scaled);
    constexpr double kRounding = 1e-12;
    if (std::abs(scaled - rounded) > kRounding * scaled || rounded < 1) continue;
    const int numerator = static_cast<int>(rounded);
    const int common = std::gcd(numerator, denominator);
    return FrameRate{numerator / common, denominator / common};
  }
  return std::nullopt;
}

std::optional<FrameRate> frame_rate_from(std::string_view ratio) {
  FrameRate rate;
  const char* const end = ratio.data() + ratio.size();
  const auto [slash, first_error] = std::from_chars(ratio.data(), end, rate.numerator);
  if (first_error != std::errc{} || slash == end || *slash != '/') return std::nullopt;
  const auto [stop, second_error] = std::from_chars(slash + 1, end, rate.denominator);
  if (second_error != std::errc{} || stop != end) return std::nullopt;
  if (rate.numerator < 1 || rate.denominator < 1 || rate.fps() > kFastest) return std::nullopt;
  return rate;
}

}  // namespace raystage
