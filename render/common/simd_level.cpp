// SPDX-License-Identifier: Apache-2.0
#include "render/common/simd_level.h"

#include <hwy/targets.h>

#include <array>
#include <cstdint>
#include <cstdlib>
#include <utility>

#include "base/error.h"
#include "render/common/dispatched_target.h"

#if HWY_ARCH_X86 && defined(__GLIBC__) && __has_include(<sys/platform/x86.h>)
#ifdef __clang__  // the header is C and uses _Bool, which only GCC knows in C++
using _Bool = bool;
#endif
#include <sys/platform/x86.h>
#define RAYSTAGE_LIBM_HAS_VARIANTS 1
#endif

namespace raystage::render {
namespace {

constexpr std::array<std::pair<SimdLevel, std::string_view>, 4> kNames{
    {{SimdLevel::kSse4, "sse4"},
     {SimdLevel::kAvx2, "avx2"},
     {SimdLevel::kAvx512, "avx512"},
     {SimdLevel::kNative, "native"}}};

#if HWY_ARCH_X86
constexpr std::array<std::pair<SimdLevel, std::int64_t>, 3> kTargets{
    {{SimdLevel::kSse4, HWY_SSE4}, {SimdLevel::kAvx2, HWY_AVX2}, {SimdLevel::kAvx512, HWY_AVX3}}};

/// Returns the enabled targets. Only this function may call SupportedTargets(): Highway 1.0.3
/// resets the dispatch to all targets in it, although it returns fewer.
std::int64_t supported_targets() {
  const std::int64_t targets = hwy::SupportedTargets();
  hwy::GetChosenTarget().Update(targets);
  return targets;
}
#endif

std::string names_of(const std::vector<SimdLevel>& levels) {
  std::string names;
  for (const SimdLevel level : levels) {
    names += (names.empty() ? "" : ", ") + std::string(simd_level_name(level));
  }
  return names;
}

/// Returns whether the C library computes with fused multiply-add, as its AVX2 variants do.
bool libm_fuses() {
#ifdef RAYSTAGE_LIBM_HAS_VARIANTS
  return CPU_FEATURE_ACTIVE(FMA) || CPU_FEATURE_ACTIVE(FMA4);
#else
  return false;
#endif
}

}  // namespace

std::string_view simd_level_name(SimdLevel level) {
  return kNames[static_cast<std::size_t>(level)].second;
}

SimdLevel parse_simd_level(std::string_view text) {
  for (const auto& [level, name] : kNames)
    if (name == text) return level;
  throw Error::bad_input("there is no SIMD level \"" + std::string(text) + "\"", "SIMD level",
                         "Use one of sse4, avx2, avx512");
}

std::vector<SimdLevel> simd_levels() {
#if HWY_ARCH_X86
  std::vector<SimdLevel> levels;
  const std::int64_t targets = supported_targets();
  for (const auto& [level, target] : kTargets)
    if ((targets & target) != 0) levels.push_back(level);
  return levels;
#else
  return {SimdLevel::kNative};
#endif
}

SimdLevel best_simd_level() { return simd_levels().back(); }

void pin_simd_level(SimdLevel level) {
#if HWY_ARCH_X86
  hwy::DisableTargets(0);
  const std::vector<SimdLevel> levels = simd_levels();
  const std::int64_t targets = supported_targets();
  for (const auto& [known, target] : kTargets) {
    if (known != level || (targets & target) == 0) continue;
    hwy::DisableTargets(target - 1);  // better targets have lower bits
    supported_targets();              // dispatch now, to avoid a race between threads
    return;
  }
#else
  const std::vector<SimdLevel> levels = simd_levels();
  if (level == SimdLevel::kNative) return;
#endif
  throw Error::bad_input(
      "this processor does not have the SIMD level " + std::string(simd_level_name(level)),
      "SIMD level", "Use one of " + names_of(levels));
}

SimdLevel kernel_simd_level() {
#if HWY_ARCH_X86
  const std::int64_t target = dispatched_target();
  return target <= HWY_AVX3   ? SimdLevel::kAvx512
         : target <= HWY_AVX2 ? SimdLevel::kAvx2
                              : SimdLevel::kSse4;
#else
  return SimdLevel::kNative;
#endif
}

std::string embree_config() {
  switch (kernel_simd_level()) {
    case SimdLevel::kAvx512:
      return "isa=avx512";
    case SimdLevel::kAvx2:
      return "isa=avx2";
    case SimdLevel::kSse4:
      return "isa=sse4.2";
    case SimdLevel::kNative:
      break;
  }
  return "";
}

std::optional<std::string> libm_tunables(SimdLevel level) {
  if (level != SimdLevel::kSse4 || !libm_fuses()) return std::nullopt;
  const char* given = std::getenv("GLIBC_TUNABLES");
  const std::string before = given != nullptr && *given != '\0' ? std::string(given) + ":" : "";
  return before + "glibc.cpu.hwcaps=-AVX2,-FMA,-FMA4";
}

}  // namespace raystage::render
