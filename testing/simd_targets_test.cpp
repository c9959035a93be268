// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest-spi.h>
#include <gtest/gtest.h>

#include "testing/test_simd_targets.h"

namespace raystage::testing {
namespace {

/// Returns the number of failures of for_each_simd_target() for a dispatch to `name_of_target`.
template <class NameOfTarget>
int failures(const NameOfTarget& name_of_target, int& checks) {
  ::testing::TestPartResultArray results;
  {
    const ::testing::ScopedFakeTestPartResultReporter reporter(
        ::testing::ScopedFakeTestPartResultReporter::INTERCEPT_ONLY_CURRENT_THREAD, &results);
    testing::for_each_simd_target(name_of_target, [&] { ++checks; });
  }
  return results.size();
}

const char* chosen_name() { return hwy::TargetName(hwy::SupportedTargets()); }

TEST(TestTargets, EachIsCheckedOnce) {
  int checks = 0;
  EXPECT_EQ(failures(chosen_name, checks), 0);
  EXPECT_EQ(checks, static_cast<int>(hwy::SupportedAndGeneratedTargets().size()));
}

#if HWY_ARCH_X86
TEST(TestTargets, KernelsThatRunUnderOneAloneFail) {
  int checks = 0;
  EXPECT_GE(failures([] { return "SSE4"; }, checks), 1);
  EXPECT_EQ(checks, 1);
}
#endif

}  // namespace
}  // namespace raystage::testing
