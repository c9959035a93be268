// SPDX-License-Identifier: Apache-2.0
#include "base/options.h"

#include <fmt/format.h>

namespace raystage {

bool is_within(std::string_view name, double value, double low, double high, std::string* reason) {
  if (value >= low && value <= high) return true;
  *reason = fmt::format("{} is {}, allowed: {} to {}", name, value, low, high);
  return false;
}

}  // namespace raystage
