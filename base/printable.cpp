// SPDX-License-Identifier: Apache-2.0
#include "base/printable.h"

#include <fmt/format.h>

#include <cstddef>

namespace raystage {
namespace {

/// `kept`: control characters that are not escaped.
std::string escaped(std::string_view text, std::string_view kept) {
  std::string safe;
  for (std::size_t i = 0; i < text.size(); ++i) {
    const auto code = static_cast<unsigned char>(text[i]);
    const auto next = static_cast<unsigned char>(i + 1 < text.size() ? text[i + 1] : 0);
    if (code == 0xC2 && next >= 0x80 && next < 0xA0) {  // U+0080 to U+009F, in UTF-8
      safe += fmt::format("\\u{:04x}", next);
      ++i;
    } else if ((code < 0x20 && kept.find(text[i]) == std::string_view::npos) || code == 0x7F) {
      safe += fmt::format("\\u{:04x}", code);
    } else {
      safe += text[i];
    }
  }
  return safe;
}

}  // namespace

std::string printable(std::string_view text) { return escaped(text, "\n\t"); }

std::string printable_in_line(std::string_view text) { return escaped(text, ""); }

}  // namespace raystage
