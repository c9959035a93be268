// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/wait.h>

#include <array>
#include <cstdio>
#include <string>

#include "testing/test_paths.h"

namespace raystage::testing {

struct CommandResult {
  int exit_code = -1;
  std::string output;  ///< standard output and standard error, interleaved
};

/// Runs a command in the shell.
inline CommandResult run_in_shell(const std::string& command) {
  CommandResult result;
  std::FILE* pipe = popen((command + " 2>&1").c_str(), "r");
  if (pipe == nullptr) return result;
  std::array<char, 4096> buffer{};
  std::size_t count = 0;
  while ((count = std::fread(buffer.data(), 1, buffer.size(), pipe)) > 0) {
    result.output.append(buffer.data(), count);
  }
  const int status = pclose(pipe);
  result.exit_code = WIFEXITED(status) ? WEXITSTATUS(status) : -1;
  return result;
}

/// Runs `raystage ARGUMENTS` in the shell.
inline CommandResult run_raystage(const std::string& arguments) {
  return run_in_shell("'" + commands_folder().string() + "/raystage' " + arguments);
}

}  // namespace raystage::testing
