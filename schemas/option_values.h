// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <variant>

namespace raystage::schemas {

/// The value of an option in a document or on a command line.
using OptionValue = std::variant<bool, double, std::string>;

/// Options by name, not validated: the reader defines the names and their meaning.
using OptionValues = std::map<std::string, OptionValue>;

}  // namespace raystage::schemas
