// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <hwy/targets.h>

#include <cstdint>
#include <iostream>
#include <set>
#include <string>

namespace raystage::testing {

/// During its lifetime, kernels use the instruction set that was chosen last.
class ScopedSimdTarget {
 public:
  ScopedSimdTarget() = default;
  ~ScopedSimdTarget() {
    hwy::SetSupportedTargetsForTest(0);
    hwy::GetChosenTarget().DeInit();
  }
  ScopedSimdTarget(const ScopedSimdTarget&) = delete;
  ScopedSimdTarget& operator=(const ScopedSimdTarget&) = delete;

  void choose(std::int64_t target) {
    hwy::SetSupportedTargetsForTest(target);
    hwy::GetChosenTarget().Update(hwy::SupportedTargets());
  }
};

/// Calls `check` for every instruction set for which kernels are compiled and that this processor
/// supports. `name_of_target` returns the target that the kernels' dispatch chose (by its name in
/// Highway); each target is checked once. On x86 it fails unless SSE4, AVX2 and AVX-512 were
/// checked; it reports, but accepts, a processor without AVX-512.
template <class NameOfTarget, class Check>
void for_each_simd_target(const NameOfTarget& name_of_target, const Check& check) {
  std::set<std::string> seen;
  {
    ScopedSimdTarget chosen;
    for (const auto target : hwy::SupportedAndGeneratedTargets()) {
      chosen.choose(target);
      const std::string name = name_of_target();
      if (!seen.insert(name).second) continue;
      SCOPED_TRACE(name);
      check();
    }
  }
#if HWY_ARCH_X86
  EXPECT_THAT(seen, ::testing::IsSupersetOf({"SSE4", "AVX2"}))
      << "not every instruction set was tested";
  if ((hwy::SupportedTargets() & HWY_AVX3) != 0) {
    EXPECT_THAT(seen, ::testing::Contains("AVX3")) << "AVX-512 was not tested";
  } else {
    std::cout << "AVX-512 not tested: this processor does not support it\n";
  }
#else
  EXPECT_FALSE(seen.empty());
#endif
}

}  // namespace raystage::testing
