// SPDX-License-Identifier: Apache-2.0
// Internal to rig_formats/: the lines of COLMAP's text files.
#pragma once

#include <fmt/format.h>

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string>
#include <string_view>
#include <utility>

#include "base/error.h"
#include "ingest/rig_formats/rig_format.h"

namespace raystage::ingest {

/// Reads a text file line by line, and a line word by word.
class LineReader {
 public:
  explicit LineReader(const NamedText& file) : name_(file.name), rest_(file.text) {}

  /// Goes to the next line; returns false at the end.
  bool next_line() {
    if (rest_.empty()) return false;
    const std::size_t end = std::min(rest_.find('\n'), rest_.size());
    line_ = rest_.substr(0, end);
    if (line_.ends_with('\r')) line_.remove_suffix(1);
    rest_.remove_prefix(std::min(end + 1, rest_.size()));
    ++number_;
    return true;
  }
  /// Goes to the next line that is neither empty nor a comment; returns false at the end.
  bool next_entry() {
    while (next_line()) {
      const std::size_t first = line_.find_first_not_of(" \t");
      if (first != line_.npos && line_[first] != '#') return true;
    }
    return false;
  }
  std::string_view word(std::string_view what) {
    skip_space();
    if (line_.empty()) throw refuse(fmt::format("the {} is missing", what));
    const std::size_t end = std::min(line_.find_first_of(" \t"), line_.size());
    const std::string_view result = line_.substr(0, end);
    line_.remove_prefix(end);
    return result;
  }
  /// Returns the rest of the line: a file name may contain spaces.
  std::string_view rest_of_line(std::string_view what) {
    skip_space();
    if (line_.empty()) throw refuse(fmt::format("the {} is missing", what));
    return line_.substr(0, line_.find_last_not_of(" \t") + 1);
  }
  bool at_end_of_line() {
    skip_space();
    return line_.empty();
  }
  template <typename Number>
  Number number(std::string_view what) {
    const std::string_view text = word(what);
    Number value{};
    const auto [stop, error] = std::from_chars(text.data(), text.data() + text.size(), value);
    const bool whole = error == std::errc{} && stop == text.data() + text.size();
    if (!whole || !std::isfinite(static_cast<double>(value))) {
      throw refuse(fmt::format("found \"{}\" for the {}, allowed: a finite number", text, what));
    }
    return value;
  }
  /// Returns "FILE:line".
  std::string place() const { return fmt::format("{}:{}", name_, number_); }
  /// Returns the error of a line that is not as COLMAP writes it.
  Error refuse(std::string what) const {
    return refuse(std::move(what),
                  "Export the model again with colmap model_converter --output_type TXT");
  }
  Error refuse(std::string what, std::string what_to_do) const {
    return Error::bad_input(std::move(what), place(), std::move(what_to_do));
  }

 private:
  void skip_space() { line_.remove_prefix(std::min(line_.find_first_not_of(" \t"), line_.size())); }
  const std::string& name_;
  std::string_view rest_, line_;
  int number_ = 0;
};

}  // namespace raystage::ingest
