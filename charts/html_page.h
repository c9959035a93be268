// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

namespace raystage::charts {

/// Returns `text` with HTML's special characters escaped.
std::string escape_html(std::string_view text);

/// Returns a self-contained HTML page that loads nothing, which its content security policy
/// enforces. Its colours are dark, or light if the reader's system is. `title` and `subtitle` are
/// text, `body` is HTML, and `style` is CSS in addition to the common style sheet.
std::string html_page(std::string_view title, std::string_view subtitle, std::string_view body,
                      std::string_view style = "");

/// Returns a panel with a heading (text), a line of explanation (HTML) and its content (HTML).
std::string html_section(std::string_view heading, std::string_view explanation,
                         std::string_view content);

}  // namespace raystage::charts
