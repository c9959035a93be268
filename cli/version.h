// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <string>

namespace raystage::cli {

/// Highway targets (HWY_AVX2 ...) for which kernels are compiled, one bit each.
extern const std::int64_t kCompiledKernelTargets;

/// Returns what --version prints: "raystage VERSION" on the first line, then the kernels that this
/// processor runs, the libraries found at build time, and compiler and build type. No final
/// newline.
std::string version_text();

}  // namespace raystage::cli
