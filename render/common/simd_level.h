// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace raystage {

/// Instruction sets that kernels are compiled for. At one level all processors that have it compute
/// the same bytes. Between levels kernels round otherwise, and `depth` decides otherwise here and
/// there.
enum class SimdLevel {
  kSse4,    ///< x86: up to SSE4.2, without fused multiply-add
  kAvx2,    ///< x86: with fused multiply-add
  kAvx512,  ///< x86: F, VL, DQ, BW and CD, no other extension of AVX-512
  kNative   ///< other processors: they have this level alone
};

/// "sse4", "avx2", "avx512" or "native".
std::string_view simd_level_name(SimdLevel level);
/// Throws Error (bad input) for any other text.
SimdLevel parse_simd_level(std::string_view text);

/// The levels of this processor, the lowest first; once one is pinned, those up to it. Not to be
/// called while threads run kernels.
std::vector<SimdLevel> simd_levels();
/// The highest of them.
SimdLevel best_simd_level();

/// Holds all Highway kernels of this process to `level`, whatever else the processor has, and with
/// them embree_config(). Not to be called while threads run kernels. Does not reach the C library's
/// mathematics: see libm_tunables(). Throws Error (bad input) where the processor lacks the level.
void pin_simd_level(SimdLevel level);

/// The level at which kernels run, as their own dispatch has it. Any thread may ask.
SimdLevel kernel_simd_level();

/// What rtcNewDevice() is to be given, so that Embree keeps to the level of the kernels.
std::string embree_config();

/// The value of the environment variable GLIBC_TUNABLES under which a process' exp(), sin() etc.
/// compute as `level` does; none: they do so in this process. glibc 2.33 or later chooses between
/// variants with and without fused multiply-add, which differ in the last bit, once, at its start.
std::optional<std::string> libm_tunables(SimdLevel level);

}  // namespace raystage
