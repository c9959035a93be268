// SPDX-License-Identifier: Apache-2.0
#include "render/common/simd_level.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <array>
#include <cstdio>
#include <string>

#include "base/error.h"
#include "render/common/dispatched_target.h"

namespace raystage::render {
namespace {

using ::testing::HasSubstr;

/// Resets the level that a test has pinned.
class SimdLevels : public ::testing::Test {
 protected:
  ~SimdLevels() override {
    hwy::SetSupportedTargetsForTest(0);
    hwy::DisableTargets(0);
  }
};

TEST_F(SimdLevels, NamesAreReadBack) {
  for (const SimdLevel level :
       {SimdLevel::kSse4, SimdLevel::kAvx2, SimdLevel::kAvx512, SimdLevel::kNative}) {
    EXPECT_EQ(parse_simd_level(simd_level_name(level)), level);
  }
  EXPECT_THROW(parse_simd_level("avx"), Error);
}

#if HWY_ARCH_X86
TEST_F(SimdLevels, APinnedLevelIsTheBest) {
  const std::vector<SimdLevel> levels = simd_levels();
  ASSERT_FALSE(levels.empty());
  EXPECT_EQ(levels.front(), SimdLevel::kSse4);
  for (const SimdLevel level : levels) {
    pin_simd_level(level);
    EXPECT_EQ(best_simd_level(), level);
    // The dispatched target must not change when the levels were queried.
    EXPECT_EQ(dispatched_target(), level == SimdLevel::kSse4   ? HWY_SSE4
                                   : level == SimdLevel::kAvx2 ? HWY_AVX2
                                                               : HWY_AVX3);
    EXPECT_EQ(kernel_simd_level(), level);
    EXPECT_EQ(embree_config(), level == SimdLevel::kSse4   ? "isa=sse4.2"
                               : level == SimdLevel::kAvx2 ? "isa=avx2"
                                                           : "isa=avx512");
  }
  pin_simd_level(levels.back());  // from any level back to a higher one
  EXPECT_EQ(simd_levels(), levels);
}

TEST_F(SimdLevels, OneThatTheProcessorLacksIsRefused) {
  hwy::SetSupportedTargetsForTest(HWY_AVX2 | HWY_SSE4 | HWY_SSSE3);
  try {
    pin_simd_level(SimdLevel::kAvx512);
    FAIL() << "pinned what is not there";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_THAT(error.what(), HasSubstr("avx512"));
    EXPECT_THAT(error.what(), HasSubstr("sse4, avx2."));
  }
  EXPECT_THROW(pin_simd_level(SimdLevel::kNative), Error);
  EXPECT_EQ(best_simd_level(), SimdLevel::kAvx2);
}

/// Returns a hash of results of another process's C library under these tunables.
std::string computed_with(const std::string& tunables) {
  const std::string command =
      "GLIBC_TUNABLES='" + tunables +
      "' python3 -c 'import math; print(hash(tuple(f(i * 1e-3 + 1e-5) for i in range(100000) for f "
      "in (math.sin, math.exp, math.log, math.tan, math.atan))))'";
  std::FILE* pipe = popen(command.c_str(), "r");
  if (pipe == nullptr) return "no process";
  std::array<char, 100> text{};
  const std::size_t length = std::fread(text.data(), 1, text.size(), pipe);
  pclose(pipe);
  return {text.data(), length};
}

TEST_F(SimdLevels, TheCLibraryIsHeldToSse4) {
  EXPECT_EQ(libm_tunables(SimdLevel::kAvx2), std::nullopt);
  EXPECT_EQ(libm_tunables(SimdLevel::kAvx512), std::nullopt);
  const auto tunables = libm_tunables(SimdLevel::kSse4);
  if (!tunables) GTEST_SKIP() << "this C library computes as on SSE4 already";
  // A processor without AVX computes the same as one whose AVX is hidden.
  const std::string held = computed_with(*tunables);
  EXPECT_GT(held.size(), 5U) << held;
  EXPECT_EQ(held, computed_with("glibc.cpu.hwcaps=-AVX,-AVX2,-FMA,-FMA4,-AVX512F"));
  EXPECT_NE(held, computed_with("")) << "this test would not see a difference";
  // Extensions of AVX-512 make no difference.
  EXPECT_EQ(computed_with(""), computed_with("glibc.cpu.hwcaps=-AVX512F,-AVX512VL,-AVX512BW"));
}
#endif

}  // namespace
}  // namespace raystage::render
