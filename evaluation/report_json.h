// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <nlohmann/json.hpp>

#include "schemas/option_values.h"

namespace raystage::evaluation {

/// Returns the number, or null for infinities and NaN, which JSON does not have.
inline nlohmann::ordered_json json_number(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
}

inline nlohmann::ordered_json json_options(const schemas::OptionValues& options) {
  auto object = nlohmann::ordered_json::object();
  for (const auto& [name, value] : options) {
    std::visit([&object, &key = name](const auto& of_type) { object[key] = of_type; }, value);
  }
  return object;
}

}  // namespace raystage::evaluation
