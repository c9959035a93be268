// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <cstdint>
#include <cstdio>
#include <string>
#include <string_view>
#include <type_traits>
#include <utility>

#include "base/printable.h"

namespace raystage::cli {

/// Returns what printable_in_line() returns of a text, and other arguments as they are.
template <class Argument>
decltype(auto) printable_argument(Argument&& argument) {
  if constexpr (std::is_convertible_v<const Argument&, std::string_view>) {
    return printable_in_line(argument);
  } else {
    return std::forward<Argument>(argument);
  }
}

/// Formats, with texts as printable_in_line() returns them.
template <class... Arguments>
std::string format_line(fmt::format_string<Arguments...> format, Arguments&&... arguments) {
  return fmt::format(fmt::runtime(fmt::string_view(format)),
                     printable_argument(std::forward<Arguments>(arguments))...);
}

/// Prints what printable() returns. run_command() reports write errors.
void print(std::FILE* to, std::string_view text);

/// Returns "3 frames are unverified: ...", for FrameRecord::is_unverified.
std::string unverified_text(std::int64_t frames);

/// Prints to standard output.
inline void print(const std::string& text) { print(stdout, text); }

/// Formats by format_line() and prints to standard output.
template <class First, class... Arguments>
void print(fmt::format_string<First, Arguments...> format, First&& first, Arguments&&... others) {
  print(stdout,
        format_line(format, std::forward<First>(first), std::forward<Arguments>(others)...));
}

/// Formats and prints to a stream.
template <class First, class... Arguments>
void print(std::FILE* to, fmt::format_string<First, Arguments...> format, First&& first,
           Arguments&&... others) {
  print(to, format_line(format, std::forward<First>(first), std::forward<Arguments>(others)...));
}

/// Formats and prints to standard error.
template <class... Arguments>
void print_error(fmt::format_string<Arguments...> format, Arguments&&... arguments) {
  print(stderr, format_line(format, std::forward<Arguments>(arguments)...));
}

}  // namespace raystage::cli
