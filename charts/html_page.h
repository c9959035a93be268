// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace raystage {

/// Text as it must stand in HTML.
std::string escape_html(std::string_view text);

/// A self-contained page: nothing is loaded from anywhere, and its policy forbids it. Dark, or
/// light where the reader's system is. `title` and `subtitle` are text; `body` is HTML; `style` is
/// CSS that the page needs beside what all have.
std::string html_page(std::string_view title, std::string_view subtitle, std::string_view body,
                      std::string_view style = "");

/// A panel with a heading (text), a line of explanation (HTML) and its content (HTML).
std::string html_section(std::string_view heading, std::string_view explanation,
                         std::string_view content);

}  // namespace raystage
