// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <unistd.h>

#include <CLI/CLI.hpp>
#include <cstdlib>
#include <cstring>
#include <optional>
#include <string>

#include "base/error.h"
#include "render/common/simd_level.h"

namespace raystage {

/// Selects the level, and restarts the program once if its C library would compute differently.
/// Throws CLI::ValidationError if the processor lacks the level.
inline void apply_simd_level(const std::string& name, char** argv) {
  try {
    const SimdLevel level = name.empty() ? best_simd_level() : parse_simd_level(name);
    pin_simd_level(level);
    const std::optional<std::string> tunables = libm_tunables(level);
    if (!tunables) return;
    const char* before = std::getenv("GLIBC_TUNABLES");
    // The program was restarted already: this C library ignores the setting.
    if (before == nullptr || std::strstr(before, "-AVX2,-FMA,-FMA4") == nullptr) {
      setenv("GLIBC_TUNABLES", tunables->c_str(), 1);
      execv("/proc/self/exe", argv);
    }
    throw CLI::ValidationError("--simd", "the C library cannot be restricted to " +
                                             std::string(simd_level_name(level)) +
                                             ". Use a higher level");
  } catch (const Error& error) {
    throw CLI::ValidationError("--simd", error.what_happened() + ". " + error.what_to_do());
  }
}

/// Adds --simd LEVEL. Takes effect at the end of parsing, before any thread starts.
inline void add_simd_option(CLI::App& app, std::string& level, char** argv) {
  app.add_option("--simd", level,
                 "instruction set of the kernels: the same one gives the same bytes on every "
                 "processor that\nhas it (default: the best of this processor)")
      ->check(CLI::IsMember({"sse4", "avx2", "avx512"}).description(""))
      ->type_name("sse4|avx2|avx512");
  app.final_callback([&level, argv] { apply_simd_level(level, argv); });
}

}  // namespace raystage
