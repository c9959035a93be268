// SPDX-License-Identifier: Apache-2.0
// Parses the frame token of an image sequence's name: "####", "@@@@" or "%04d". Formats and
// recognises file names of frames. Cost: linear in the length of the name.
#include "compose/sequence_name.h"

#include <fmt/format.h>

#include "base/error.h"
#include "base/number_text.h"

namespace raystage::compose {
namespace {

constexpr int kMaxPadding = 16;

bool is_digit(char c) { return c >= '0' && c <= '9'; }

struct Token {
  std::size_t begin = 0, end = 0;
  int padding = 0;
};

/// Returns the token that starts at `at`, or nullopt.
std::optional<Token> token_at(std::string_view text, std::size_t at) {
  const char c = text[at];
  std::size_t end = at;
  if (c == '#' || c == '@') {
    while (end < text.size() && text[end] == c) ++end;
    const auto length = static_cast<int>(std::min<std::size_t>(end - at, kMaxPadding + 1));
    return Token{at, end, c == '#' && length == 1 ? 4 : length};
  }
  if (c != '%') return std::nullopt;
  ++end;
  int padding = 0;
  while (end < text.size() && is_digit(text[end]) && padding <= kMaxPadding) {
    padding = padding * 10 + (text[end++] - '0');
  }
  const bool zero_padded = padding == 0 || text[at + 1] == '0';
  if (end >= text.size() || text[end] != 'd' || !zero_padded) {
    throw Error::bad_input("the token after '%' is unknown", std::string(text),
                           "Write %04d or #### for the frame number");
  }
  return Token{at, end + 1, std::max(padding, 1)};
}

}  // namespace

SequenceName::SequenceName(std::string_view pattern) : pattern_(pattern), before_(pattern) {
  const std::size_t slash = pattern.rfind('/');
  const std::size_t name_begin = slash == std::string_view::npos ? 0 : slash + 1;
  if (pattern.size() == name_begin) {
    throw Error::bad_input("the file name is missing", pattern_,
                           "Write FOLDER/NAME.####.exr for a sequence");
  }
  for (std::size_t at = name_begin; at < pattern.size(); ++at) {
    const auto token = token_at(pattern, at);
    if (!token) continue;
    if (has_token_) {
      throw Error::bad_input("the name has two frame tokens", pattern_,
                             "Keep one of #### and %04d");
    }
    if (token->padding > kMaxPadding) {
      throw Error::bad_input(fmt::format("the frame token has more than {} digits", kMaxPadding),
                             pattern_, "Write #### for four digits");
    }
    has_token_ = true;
    padding_ = token->padding;
    before_ = pattern.substr(0, token->begin);
    after_ = pattern.substr(token->end);
    at = token->end - 1;
  }
  // Folder names may contain '@' and '%'.
  const std::string_view folders = pattern.substr(0, name_begin);
  if (!has_token_ && (folders.find("##") != std::string_view::npos)) {
    throw Error::bad_input("a folder name has the frame token", pattern_,
                           "Put #### into the file name");
  }
}

std::filesystem::path SequenceName::folder() const {
  const auto folder = std::filesystem::path(pattern_).parent_path();
  return folder.empty() ? std::filesystem::path(".") : folder;
}

std::string SequenceName::number(int frame) const {
  return fmt::format("{:0{}d}", frame, padding_);
}

std::filesystem::path SequenceName::path(int frame) const {
  return has_token_ ? before_ + number(frame) + after_ : pattern_;
}

SequenceName SequenceName::with(std::string_view word) const {
  const std::string name = std::string(word) + ".";
  if (has_token_) return SequenceName(before_ + name + pattern_.substr(before_.size()));
  const std::string extension = std::filesystem::path(pattern_).extension();
  const std::size_t end = pattern_.size() - extension.size();
  return SequenceName(pattern_.substr(0, end) + "." + std::string(word) + extension);
}

std::optional<int> SequenceName::frame_from_file_name(std::string_view file_name) const {
  if (!has_token_) return std::nullopt;
  // npos + 1 == 0
  const std::string_view before = std::string_view(before_).substr(before_.find_last_of('/') + 1);
  if (file_name.size() < before.size() + after_.size() || !file_name.starts_with(before) ||
      !file_name.ends_with(after_)) {
    return std::nullopt;
  }
  const std::string_view digits =
      file_name.substr(before.size(), file_name.size() - before.size() - after_.size());
  const auto frame = parse_number<int>(digits);
  return frame && number(*frame) == digits ? frame : std::nullopt;
}

}  // namespace raystage::compose
