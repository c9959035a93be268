// SPDX-License-Identifier: Apache-2.0
#include "depths/map_checks.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <optional>
#include <vector>

namespace raystage::depths {
namespace {

using ::testing::DoubleNear;
using ::testing::Pointwise;

TEST(MapChecks, OnlyFewImplausibleDepthsAreOutliers) {
  const auto too_near = [](std::size_t pixels, double depth,
                           const std::optional<schemas::DepthRange>& scene = {},
                           double parallax = 2000) {
    render::InverseDepthMap map(100, 100, 0.01F);  // 100 m
    std::fill_n(map.values.begin(), pixels, static_cast<float>(1 / depth));
    std::vector<float> before = map.values;
    const std::size_t count = check_map(map, parallax, scene).too_near;
    std::fill_n(before.begin(), count, render::kUnknownDepth);
    EXPECT_EQ(map.values, before);
    return count;
  };
  EXPECT_EQ(too_near(1, 0.01), 1U);
  EXPECT_EQ(too_near(100, 0.01), 100U);
  EXPECT_EQ(too_near(101, 0.01), 0U);  // more than 1 %
  EXPECT_EQ(too_near(1, 1.5), 1U);
  EXPECT_EQ(too_near(1, 1.6), 0U);                                   // less than 64 times nearer
  EXPECT_EQ(too_near(1, 0.01, schemas::DepthRange{0.02, 200}), 0U);  // plausible
  EXPECT_EQ(too_near(1, 0.01, schemas::DepthRange{1, 200}), 1U);
  EXPECT_EQ(too_near(1, 0.01, {}, 6), 0U);  // costs others less than 0.01 pixels
}

// The disparity is that to the nearest other station; without one it is that of a usual array.
TEST(MapChecks, ParallaxIsFocalLengthTimesBaseline) {
  rig::Rig rig;
  for (const double x : {0.0, 0.2, 0.5, 0.5003}) {
    rig::Pose pose;
    pose.position.x() = x;
    const rig::CameraModel model({"a", 640, 480, {500, 510, 320, 240, {}}, {}, {}, {}});
    rig.cameras.push_back({"a", model, pose, {}, {}, {}});
  }
  EXPECT_THAT(neighbour_parallaxes(rig),
              Pointwise(DoubleNear(1e-9), {102.0, 102.0, 153.0, 153.153}));
  rig.cameras.resize(1, rig.cameras[0]);
  EXPECT_THAT(neighbour_parallaxes(rig), Pointwise(DoubleNear(1e-9), {51.0}));
}

}  // namespace
}  // namespace raystage::depths
