// SPDX-License-Identifier: Apache-2.0
// The codes of depth images. Normalised inverse depths as in ISO/IEC 23090-12 (MPEG immersive
// video) and its reference view synthesiser, with code 0 for unknown depths.
#include "depths/depth_encoding.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>

#include "base/options.h"

namespace raystage::depths {
namespace {

constexpr double kMinUnit = 1e-9, kMaxUnit = 1e6;
constexpr double kMinNear = 1e-6, kMaxNear = 1e9;

double slope_of(const schemas::DepthRange& range) { return 1 / range.near - 1 / range.far; }

}  // namespace

bool DepthEncoding::is_valid(std::string* reason) const {
  const auto refuse = [&](const char* why) {
    if (reason != nullptr) *reason = why;
    return false;
  };
  if (unit_m && !is_within("unit_m", *unit_m, kMinUnit, kMaxUnit, reason)) return false;
  if (!inverse_range) return true;
  if (!is_within("near", inverse_range->near, kMinNear, kMaxNear, reason)) return false;
  if (!(inverse_range->far > inverse_range->near)) return refuse("far is not greater than near");
  if (unit_m) return refuse("codes have either a unit or a range of inverse depths");
  return true;
}

std::string describe(const DepthEncoding& encoding, bool is_exr) {
  const char* quantity =
      encoding.quantity == render::DepthQuantity::kPlanar ? "planar depth" : "distance";
  if (is_exr) {
    return fmt::format("EXR, channel {}, {}, {:g} m a unit",
                       encoding.channel.empty() ? "Z" : encoding.channel, quantity,
                       encoding.unit_m.value_or(1));
  }
  if (encoding.inverse_range) {
    return fmt::format("16-bit PNG, inverse {} from {:g} m (code 65535) to {:g} m (code 0)",
                       quantity, encoding.inverse_range->near, encoding.inverse_range->far);
  }
  return fmt::format("16-bit PNG, {}, {:g} m a code", quantity, encoding.unit_m.value_or(1));
}

float inverse_depth_of_code(std::uint16_t code, const schemas::DepthRange& range) {
  if (code == 0) return render::kUnknownDepth;
  return static_cast<float>(code / double{kMaxDepthCode} * slope_of(range) + 1 / range.far);
}

std::uint16_t code_of_inverse_depth(float inverse_depth, const schemas::DepthRange& range) {
  if (inverse_depth < 0) return 0;
  const double share = (inverse_depth - 1 / range.far) / slope_of(range);
  return static_cast<std::uint16_t>(
      std::lround(std::clamp(share * kMaxDepthCode, 1.0, double{kMaxDepthCode})));
}

}  // namespace raystage::depths
