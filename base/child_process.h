// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <functional>
#include <stop_token>
#include <string>
#include <string_view>
#include <vector>

namespace raystage {

struct ChildOptions {
  /// File to which the output is appended; a regular one and no link, or nothing is. Empty: none.
  std::filesystem::path log = {};
  /// Called with each line that the child prints on either stream.
  std::function<void(std::string_view)> line = [](std::string_view) {};
  std::stop_token stop = {};   ///< on request the child gets SIGTERM and may end by itself
  double timeout_seconds = 0;  ///< after it the child gets SIGKILL; 0: no limit
  std::string input = {};      ///< passed to its standard input
  std::size_t max_output_bytes = std::size_t{1} << 20;  ///< limit of ChildResult::out
};

struct ChildResult {
  int exit_code = -1;  ///< 128 + n if signal n ended the child
  int signal = 0;      ///< the signal that ended the child; 0: none
  bool timed_out = false;
  double wall_seconds = 0, cpu_seconds = 0;
  double peak_memory_bytes = 0;  ///< largest resident set size
  std::string out;               ///< the first ChildOptions::max_output_bytes of both streams
};

/// Runs a program and waits for its end. A name without '/' is searched on the PATH. Standard
/// output and standard error are merged. Throws Error (failed) if the program cannot be started.
ChildResult run_child(const std::vector<std::string>& command, const ChildOptions& options = {});

/// Returns the path of an executable in this program's folder, e.g. "raystage-render".
std::filesystem::path sibling_program(std::string_view name);

}  // namespace raystage
