// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace raystage {

/// Returns the text with control characters except line ends and tabs as \u00NN, as in JSON: names
/// in documents of strangers must not control a terminal.
std::string printable(std::string_view text);

/// The same, also of line ends and tabs: a name must not look like a line of a report.
std::string printable_in_line(std::string_view text);

}  // namespace raystage
