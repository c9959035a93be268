// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>
#include <nlohmann/json.hpp>

#include "schemas/option_values.h"

namespace raystage {

/// JSON has no infinities and nothing that is not a number: null stands for them.
inline nlohmann::ordered_json json_number(double value) {
  return std::isfinite(value) ? nlohmann::ordered_json(value) : nlohmann::ordered_json(nullptr);
}

/// An object of the options by name.
inline nlohmann::ordered_json json_options(const OptionValues& options) {
  auto object = nlohmann::ordered_json::object();
  for (const auto& [name, value] : options) {
    std::visit([&object, &key = name](const auto& of_type) { object[key] = of_type; }, value);
  }
  return object;
}

}  // namespace raystage
