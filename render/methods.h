// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "render/common/method.h"

namespace raystage {

/// All there are, by name.
std::span<const Method* const> methods();

/// Returns the method of that name, or null.
const Method* find_method(std::string_view name);

/// Throws Error (bad input) naming the methods there are, unless `name` is one.
const Method& method_named(std::string_view name);

/// Returns the names of all methods, separated by commas.
std::string method_names();

/// For people: the methods, a line each, with their options below.
std::string describe_methods();

}  // namespace raystage
