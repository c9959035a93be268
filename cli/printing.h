// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>
#include <utility>

namespace raystage::cli {

/// Returns the text with control characters except line ends and tabs as \u00NN, as in JSON: names
/// in documents of strangers must not control a terminal.
std::string printable(std::string_view text);

/// Prints what printable() returns. run_command() reports write errors.
void print(std::FILE* to, std::string_view text);

/// Returns "3 frames are unverified: ...", for FrameRecord::is_unverified.
std::string unverified_text(std::int64_t frames);

/// Prints to standard output.
inline void print(const std::string& text) { print(stdout, text); }

/// Formats and prints to standard output.
template <class First, class... Arguments>
void print(fmt::format_string<First, Arguments...> format, First&& first, Arguments&&... others) {
  print(stdout,
        fmt::format(format, std::forward<First>(first), std::forward<Arguments>(others)...));
}

/// Formats and prints to a stream.
template <class First, class... Arguments>
void print(std::FILE* to, fmt::format_string<First, Arguments...> format, First&& first,
           Arguments&&... others) {
  print(to, fmt::format(format, std::forward<First>(first), std::forward<Arguments>(others)...));
}

/// Formats and prints to standard error.
template <class... Arguments>
void print_error(fmt::format_string<Arguments...> format, Arguments&&... arguments) {
  print(stderr, fmt::format(format, std::forward<Arguments>(arguments)...));
}

}  // namespace raystage::cli
