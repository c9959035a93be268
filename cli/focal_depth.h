// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "base/error.h"

namespace raystage {

/// Parses --focal-depth: "best" (nullopt) or metres. Throws Error (bad input).
inline std::optional<double> parse_focal_depth(const std::string& text) {
  if (text == "best") return std::nullopt;
  std::size_t used = 0;
  double depth = 0;
  try {
    depth = std::stod(text, &used);
  } catch (const std::exception&) {
    used = 0;
  }
  if (used == 0 || used != text.size() || !(depth > 0)) {
    throw Error::bad_input("found '" + text + "', allowed: best, or a depth above 0 in metres",
                           "--focal-depth", "Use for example --focal-depth 4.5");
  }
  return depth;
}

}  // namespace raystage
