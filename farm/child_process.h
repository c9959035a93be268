// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

namespace raystage::farm {

struct ChildOptions {
  std::filesystem::path log = {};  ///< what it prints is appended; empty: nowhere
  /// Each line of what it prints on either stream.
  std::function<void(std::string_view)> line = [](std::string_view) {};
  std::stop_token stop = {};   ///< requested: the child gets SIGTERM, and has its time to end
  double timeout_seconds = 0;  ///< 0: none; then SIGKILL
  std::string input = {};      ///< on its standard input
  std::size_t max_output_bytes = std::size_t{1} << 20;  ///< of what it prints, for ChildResult::out
};

struct ChildResult {
  int exit_code = -1;  ///< 128 + n where signal n ended it
  int signal = 0;      ///< n, else 0
  bool timed_out = false;
  double wall_seconds = 0, cpu_seconds = 0;
  double peak_memory_bytes = 0;  ///< largest resident size
  std::string out;               ///< both streams, its first ChildOptions::max_output_bytes
};

/// Runs a program (found on the PATH unless it has a '/') to its end; its standard output and error
/// are one stream. Throws Error (failed) where it cannot be started.
ChildResult run_child(const std::vector<std::string>& command, const ChildOptions& options = {});

/// An executable next to this program's own, e.g. "raystage-render".
std::filesystem::path sibling_program(std::string_view name);

}  // namespace raystage::farm
