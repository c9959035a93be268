// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <cmath>
#include <string>

namespace raystage::evaluation {

/// Returns "-" for NaN: a view without covered pixels has no error.
inline std::string format_number_or_dash(double value, int decimals) {
  return std::isnan(value) ? "-" : fmt::format("{:.{}f}", value, decimals);
}

}  // namespace raystage::evaluation
