// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <variant>

namespace raystage {

/// The value of an option in a document or on a command line.
using OptionValue = std::variant<bool, double, std::string>;

/// Options by name, as given. Their reader defines which names exist and what they mean.
using OptionValues = std::map<std::string, OptionValue>;

}  // namespace raystage
