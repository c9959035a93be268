// SPDX-License-Identifier: Apache-2.0
#include "schemas/utf8_text.h"

#include <nlohmann/json.hpp>

namespace raystage::schemas {
namespace {

std::string with_replacements(std::string_view text) {
  using Text = nlohmann::ordered_json;
  return Text::parse(Text(text).dump(-1, ' ', false, Text::error_handler_t::replace))
      .get<std::string>();
}

}  // namespace

bool is_utf8(std::string_view text) { return with_replacements(text) == text; }

std::string utf8_text(std::string_view text, std::size_t most) {
  std::string utf8 = with_replacements(text);
  if (utf8.size() <= most) return utf8;
  std::size_t end = most;
  while (end > 0 && (static_cast<unsigned char>(utf8[end]) & 0xc0u) == 0x80) --end;
  utf8.resize(end);
  return utf8;
}

}  // namespace raystage::schemas
