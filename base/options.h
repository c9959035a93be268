// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "base/error.h"

namespace raystage {

// Options of a function are a plain struct XOptions with defaults. Its is_valid(std::string*
// reason) returns whether all values are usable; if not, `reason` gets a sentence without a full
// stop.

/// Returns whether low <= value <= high. If not, and for NaN, writes "NAME is VALUE, allowed: LOW
/// to HIGH" to `reason`.
bool is_within(std::string_view name, double value, double low, double high, std::string* reason);

/// Throws Error (bad input) with the reason if the options are not valid. `where`: what the options
/// are for, such as a file.
template <class Options>
void require_valid(const Options& options, std::string_view where = "options") {
  std::string reason;
  if (!options.is_valid(&reason)) {
    throw Error::bad_input(std::move(reason), std::string(where), "Give a value that is allowed");
  }
}

}  // namespace raystage
