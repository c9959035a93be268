// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <string>
#include <string_view>

namespace raystage::schemas {

/// Returns whether a text is valid UTF-8, as JSON has to be. Names of files need not be.
bool is_utf8(std::string_view text);

/// Returns a text of at most `most` bytes that JSON can hold: what is not valid UTF-8 becomes
/// U+FFFD, and no character is cut.
std::string utf8_text(std::string_view text, std::size_t most);

}  // namespace raystage::schemas
