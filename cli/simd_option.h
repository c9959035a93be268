// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <unistd.h>

#include <cstdlib>
#include <cstring>
#include <optional>
#include <string>

#include "base/error.h"
#include "cli/command_line.h"
#include "render/common/simd_level.h"

namespace raystage::cli {

/// Selects the level, and restarts the program once if its C library would compute differently.
/// Throws Error (bad input) if the processor lacks the level.
inline void apply_simd_level(const std::string& name, char** argv) {
  try {
    const render::SimdLevel level =
        name.empty() ? render::best_simd_level() : render::parse_simd_level(name);
    render::pin_simd_level(level);
    const std::optional<std::string> tunables = render::libm_tunables(level);
    if (!tunables) return;
    const char* before = std::getenv("GLIBC_TUNABLES");
    // Already restarted: this C library ignores the setting.
    if (before == nullptr || std::strstr(before, "-AVX2,-FMA,-FMA4") == nullptr) {
      setenv("GLIBC_TUNABLES", tunables->c_str(), 1);
      execv("/proc/self/exe", argv);
    }
    throw Error::bad_input(
        "the C library cannot be restricted to " + std::string(render::simd_level_name(level)),
        "--simd", "Use a higher level");
  } catch (const Error& error) {
    throw Error::bad_input(error.what_happened(), "--simd", error.what_to_do());
  }
}

/// Adds --simd LEVEL. Takes effect at the end of parsing, before any thread starts.
inline void add_simd_option(CommandLine& command, std::string& level, char** argv) {
  command
      .option("--simd", level,
              "instruction set of the kernels; results are identical on all processors that "
              "support it\n(default: the best of this processor)")
      .one_of({"sse4", "avx2", "avx512"});
  command.after_parsing([&level, argv] { apply_simd_level(level, argv); });
}

}  // namespace raystage::cli
