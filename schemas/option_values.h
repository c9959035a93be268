// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <map>
#include <string>
#include <variant>

namespace raystage {

/// A setting as a document or a command line gives it.
using OptionValue = std::variant<bool, double, std::string>;

/// Settings by name, as given: what they mean, and which there are, is for their reader to say.
using OptionValues = std::map<std::string, OptionValue>;

}  // namespace raystage
