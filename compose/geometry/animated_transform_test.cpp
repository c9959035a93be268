// SPDX-License-Identifier: Apache-2.0
#include "compose/geometry/animated_transform.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <limits>

#include "base/error.h"

namespace raystage::compose {
namespace {

using Eigen::Vector3d;

TEST(AnimatedTransform, WithoutKeysAsInTheFile) {
  const AnimatedTransform placement({.file = "m.obj"}, "layer");
  EXPECT_TRUE(placement.world_from_object(17).isApprox(Eigen::Affine3d::Identity(), 0));
}

TEST(AnimatedTransform, EachPropertyHasItsOwnKeys) {
  schemas::ShotDocument::Geometry geometry{.file = "m.obj"};
  const double half = std::sqrt(0.5);
  geometry.keys = {{.frame = 1, .position = {{0, 0, 0}}, .scale = 2},
                   {.frame = 5, .orientation = {{half, 0, half, 0}}},  // 90 degrees about y
                   {.frame = 11, .position = {{10, 0, 0}}}};
  const AnimatedTransform placement(geometry, "layer");
  const Vector3d corner(1, 0, 0);
  EXPECT_TRUE((placement.world_from_object(1) * corner).isApprox(Vector3d(0, 0, -2), 1e-12));
  EXPECT_TRUE((placement.world_from_object(6) * corner).isApprox(Vector3d(5, 0, -2), 1e-12));
  EXPECT_TRUE((placement.world_from_object(99) * corner).isApprox(Vector3d(10, 0, -2), 1e-12));
}

TEST(AnimatedTransform, RefusesWhatIsNoPlace) {
  const double nan = std::numeric_limits<double>::quiet_NaN();
  for (const schemas::ShotDocument::TransformKey& key :
       {schemas::ShotDocument::TransformKey{.frame = nan},
        {.frame = 1, .position = {{0, nan, 0}}},
        {.frame = 1, .orientation = {{0, 0, 0, 0}}},
        {.frame = 1, .scale = 0}}) {
    schemas::ShotDocument::Geometry geometry{.file = "m.obj"};
    geometry.keys = {key};
    try {
      const AnimatedTransform placement(geometry, "shot.json#/layers/2/geometry");
      ADD_FAILURE();
    } catch (const Error& error) {
      EXPECT_THAT(error.what(), ::testing::HasSubstr("shot.json#/layers/2/geometry/keys/0"));
    }
  }
}

}  // namespace
}  // namespace raystage::compose
