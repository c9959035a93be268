// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <unistd.h>

#include <algorithm>
#include <cstdint>
#include <filesystem>
#include <fstream>
#include <limits>
#include <sstream>
#include <string>
#include <system_error>

namespace raystage::testing {

#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
inline constexpr bool kDecodersHaveLimits = false;  // instrumented builds need far more
#else
inline constexpr bool kDecodersHaveLimits = true;
#endif

/// Returns the largest amount of data that a decoder of this process may allocate, bytes
/// (RLIMIT_DATA); 0: none runs.
inline std::uint64_t largest_data_limit_of_decoders() {
  namespace fs = std::filesystem;
  const auto text_of = [](const fs::path& file) {
    std::ostringstream text;
    text << std::ifstream(file).rdbuf();
    return text.str();
  };
  std::uint64_t largest = 0;
  std::error_code error;
  for (fs::directory_iterator entry("/proc", error), end; !error && entry != end;
       entry.increment(error)) {
    const std::string status = text_of(entry->path() / "status");
    const bool is_child = status.find("\nPPid:\t" + std::to_string(getpid()) + "\n") != status.npos;
    if (!is_child || !status.starts_with("Name:\traystage-")) continue;
    const std::string limits = text_of(entry->path() / "limits");
    constexpr std::string_view kLine = "Max data size";
    const std::size_t line = limits.find(kLine);
    if (line == limits.npos) continue;
    std::istringstream words(limits.substr(line + kLine.size()));
    std::uint64_t bytes = 0;
    if (!(words >> bytes)) bytes = std::numeric_limits<std::uint64_t>::max();  // "unlimited"
    largest = std::max(largest, bytes);
  }
  return largest;
}

}  // namespace raystage::testing
