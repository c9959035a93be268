// SPDX-License-Identifier: Apache-2.0
#include "cli/version.h"

#include <hwy/targets.h>

#include <algorithm>
#include <cctype>

#include "raystage_build.h"
#include "raystage_version.h"

namespace raystage::cli {
namespace {

/// Returns the instruction set's name as processors list it: Highway calls AVX-512 "AVX3".
std::string target_name(std::int64_t target) {
  std::string name = hwy::TargetName(target);
  std::transform(name.begin(), name.end(), name.begin(),
                 [](unsigned char letter) { return static_cast<char>(std::tolower(letter)); });
  if (name.starts_with("avx3")) name.replace(0, 4, "avx512");
  return name;
}

/// Returns the best of the compiled targets that this processor supports, and all compiled ones
/// from the least to the best. Highway gives better targets lower bits.
std::string kernels() {
  const std::int64_t usable = hwy::SupportedTargets() & kCompiledKernelTargets;
  std::string compiled;
  for (std::int64_t rest = kCompiledKernelTargets; rest != 0; rest &= rest - 1) {
    const std::string name = target_name(rest & -rest);
    compiled = compiled.empty() ? name : name + " " + compiled;
  }
  return (usable == 0 ? "none" : target_name(usable & -usable)) + " (compiled: " + compiled + ")";
}

}  // namespace

std::string version_text() {
  return "raystage " RAYSTAGE_VERSION "\nkernels: " + kernels() +
         "\nlibraries: " RAYSTAGE_LIBRARY_VERSIONS "\ncompiler: " RAYSTAGE_COMPILER
         ", build type: " RAYSTAGE_BUILD_TYPE;
}

}  // namespace raystage::cli
