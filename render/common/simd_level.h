// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace raystage::render {

/// Instruction sets for which kernels are compiled. At one level all processors that have it
/// compute the same bytes. Between levels kernels round differently, so that `depth` chooses
/// other surfaces at some pixels.
enum class SimdLevel {
  kSse4,    ///< x86: up to SSE4.2, without fused multiply-add
  kAvx2,    ///< x86: with fused multiply-add
  kAvx512,  ///< x86: F, VL, DQ, BW and CD, no other extension of AVX-512
  kNative   ///< other processors, which have only this level
};

/// Returns "sse4", "avx2", "avx512" or "native".
std::string_view simd_level_name(SimdLevel level);
/// Returns the level of that name. Throws Error (bad input) for any other text.
SimdLevel parse_simd_level(std::string_view text);

/// Returns the levels of this processor, the lowest first; after pin_simd_level() only those up to
/// the pinned level. Must not be called while threads run kernels.
std::vector<SimdLevel> simd_levels();
/// Returns the highest of simd_levels().
SimdLevel best_simd_level();

/// Restricts all Highway kernels of this process, and embree_config(), to `level`, whatever else
/// the processor has. Must not be called while threads run kernels. The mathematics of the C
/// library is not affected: see libm_tunables(). Throws Error (bad input) where the processor lacks
/// the level.
void pin_simd_level(SimdLevel level);

/// Returns the level at which kernels run, as their own dispatch determines it. Thread-safe.
SimdLevel kernel_simd_level();

/// Returns the configuration for rtcNewDevice() with which Embree uses the level of the kernels.
std::string embree_config();

/// Returns the value of the environment variable GLIBC_TUNABLES with which exp(), sin() etc. of a
/// process compute as `level` does; nullopt if they do so in this process. At its start, glibc 2.33
/// or later chooses between variants with and without fused multiply-add, which differ in the last
/// bit.
std::optional<std::string> libm_tunables(SimdLevel level);

}  // namespace raystage::render
