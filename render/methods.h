// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "render/common/method.h"

namespace raystage::render {

/// Returns all methods.
std::span<const Method* const> methods();

/// Returns the method of that name, or null.
const Method* find_method(std::string_view name);

/// Returns the method `name`. Throws Error (bad input), listing the methods, if there is none.
const Method& method_named(std::string_view name);

/// Returns the names of all methods, separated by commas.
std::string method_names();

/// Returns help for the user: one line per method, followed by its options.
std::string describe_methods();

}  // namespace raystage::render
