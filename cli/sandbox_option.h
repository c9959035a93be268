// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdlib>

#include "cli/command_line.h"
#include "sandbox/decoder_process.h"

namespace raystage::cli {

/// Adds --unsandboxed. It sets an environment variable, which processes that the command starts
/// inherit.
inline void add_sandbox_option(CommandLine& command) {
  command.flag(
      "--unsandboxed", [] { ::setenv(sandbox::kUnsandboxedVariable, "1", 1); },
      "decode meshes, pictures, movies and packed frames without a filter of system calls, where "
      "the kernel has "
      "none (seccomp): only files that you trust");
}

}  // namespace raystage::cli
