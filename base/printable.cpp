// SPDX-License-Identifier: Apache-2.0
#include "base/printable.h"

#include <fmt/format.h>

#include <cstddef>

namespace raystage {
namespace {

/// Returns how many bytes the character at the start of a text has in UTF-8, by its first byte and
/// those that follow; 1 if they are none in UTF-8.
std::size_t character_size(std::string_view text) {
  const auto lead = static_cast<unsigned char>(text[0]);
  const std::size_t size = lead >= 0xF0 ? 4 : lead >= 0xE0 ? 3 : lead >= 0xC2 ? 2 : 1;
  if (lead > 0xF4 || size > text.size()) return 1;
  if (size > 2) {  // neither longer than necessary, nor a surrogate, nor beyond U+10FFFF
    const auto second = static_cast<unsigned char>(text[1]);
    if ((lead == 0xE0 && second < 0xA0) || (lead == 0xED && second > 0x9F) ||
        (lead == 0xF0 && second < 0x90) || (lead == 0xF4 && second > 0x8F)) {
      return 1;
    }
  }
  for (const char c : text.substr(1, size - 1)) {
    if ((static_cast<unsigned char>(c) & 0xC0) != 0x80) return 1;
  }
  return size;
}

bool is_c1(unsigned char code) { return code >= 0x80 && code < 0xA0; }

/// `kept`: control characters that are not escaped.
std::string escaped(std::string_view text, std::string_view kept) {
  std::string safe;
  for (std::size_t i = 0, size = 0; i < text.size(); i += size) {
    size = character_size(text.substr(i));
    const auto code = static_cast<unsigned char>(text[i]);
    const auto last = static_cast<unsigned char>(text[i + size - 1]);
    const bool is_c0 = code < 0x20 && kept.find(text[i]) == std::string_view::npos;
    // Terminals of 8 bits take the bytes of C1 by themselves, others U+0080 to U+009F.
    if (is_c0 || code == 0x7F || (is_c1(last) && (size == 1 || code == 0xC2))) {
      safe += fmt::format("\\u{:04x}", last);
    } else {
      safe += text.substr(i, size);
    }
  }
  return safe;
}

}  // namespace

std::string printable(std::string_view text) { return escaped(text, "\n\t"); }

std::string printable_in_line(std::string_view text) { return escaped(text, ""); }

}  // namespace raystage
