// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>

#include <string>

#include "render/sampling/source_view.h"
#include "testing/render/kernel_accuracy.h"
#include "testing/test_simd_targets.h"

namespace raystage::render {
namespace {

using testing::ExtremeView;
using testing::GeometryErrors;
using testing::ViewAccuracy;

void expect_accurate(const ViewAccuracy& accuracy) {
  const GeometryErrors &in_double = accuracy.in_double, &in_kernels = accuracy.in_kernels;
  EXPECT_LT(in_double.weight, 1e-11);
  EXPECT_LT(in_double.weight_sum, 1e-14);
  EXPECT_LT(in_double.position, 1e-9);
  EXPECT_LT(in_double.depth, 1e-13);
  EXPECT_LT(in_kernels.weight, 1e-6);
  EXPECT_LT(in_kernels.weight_sum, 1e-6);
  EXPECT_LT(in_kernels.position, 1e-3);
  EXPECT_LT(in_kernels.depth, 1e-6);
}

TEST(KernelExtremes, EveryInstructionSetIsNearTo50Digits) {
  testing::for_each_simd_target(kernel_target, [&] {
    for (const ExtremeView& extreme : testing::extremes()) {
      SCOPED_TRACE(std::string(kernel_target()) + ": " + extreme.name);
      const ViewAccuracy accuracy = testing::measure_accuracy(extreme);
      expect_accurate(accuracy);
      EXPECT_EQ(accuracy.in_kernels.positions_compared > 0, !extreme.blank);
      EXPECT_EQ(accuracy.in_kernels.weights_compared > 0, !extreme.blank);
    }
  });
}

}  // namespace
}  // namespace raystage::render
