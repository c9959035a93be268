// SPDX-License-Identifier: Apache-2.0
#include "cli/printing.h"

namespace raystage::cli {

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

// fmt::print throws if it cannot write, which must not end a render.
void print(std::FILE* to, std::string_view text) {
  const std::string safe = printable(text);
  std::fwrite(safe.data(), 1, safe.size(), to);
}

std::string unverified_text(std::int64_t frames) {
  return fmt::format("{} unverified: {} lost, and nothing shows whether the bytes are as recorded",
                     frames == 1 ? "1 frame is" : fmt::format("{} frames are", frames),
                     frames == 1 ? "its record was" : "their records were");
}

}  // namespace raystage::cli
