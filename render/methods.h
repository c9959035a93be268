// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <string_view>

#include "render/view/method.h"

namespace raystage {

/// All there are, by name.
std::span<const Method> methods();

/// Throws Error (bad input) naming the methods there are, unless `name` is one.
const Method& method_named(std::string_view name);

/// For people: the methods, a line each, with their options below.
std::string describe_methods();

}  // namespace raystage
