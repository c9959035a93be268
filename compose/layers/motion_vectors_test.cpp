// SPDX-License-Identifier: Apache-2.0
#include "compose/layers/motion_vectors.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>

namespace raystage::compose {
namespace {

using Eigen::Vector4d;

/// A camera of 64 x 48 pixels, 64 pixels per metre at 1 m.
render::VirtualCamera camera_at(double x, double y, double z) {
  render::VirtualCamera view;
  view.width = 64;
  view.height = 48;
  view.intrinsics = {64, 64, 32, 24, {}};
  view.pose.position = {x, y, z};
  return view;
}

// The numbers of Blender 3.4 (Cycles) for a plane at 1 m that moves by (0.1, 0.03) to this frame
// and by (0.2, 0.05) to the next one: a vector pass of -6.4, -1.92, -12.8, -3.2.
TEST(MotionVector, IsThatOfBlender) {
  const render::VirtualCamera still = camera_at(0, 0, 0);
  const auto motion = motion_vector(
      still, {still, still},
      {Vector4d(-0.1, -0.03, -1, 1), Vector4d(0, 0, -1, 1), Vector4d(0.2, 0.05, -1, 1)});
  EXPECT_NEAR(motion[0], -6.4, 1e-5);
  EXPECT_NEAR(motion[1], -1.92, 1e-5);
  EXPECT_NEAR(motion[2], -12.8, 1e-5);
  EXPECT_NEAR(motion[3], -3.2, 1e-5);
}

TEST(MotionVector, OfCamerasThatMove) {
  LayerImage image = transparent_layer_image(64, 48);
  for (float& value : image.rgba) value = 1;
  image.z.assign(image.pixels(), 2);
  image.z[5] = std::numeric_limits<float>::infinity();
  image.rgba[4 * 7 + 3] = 0;
  add_camera_motion(camera_at(0, 0, 0), {camera_at(-0.1, 0, 0), camera_at(0, 0.05, 0)}, image);
  ASSERT_EQ(image.aovs.size(), 1U);
  EXPECT_EQ(image.aovs[0].layer, "motion");
  const auto motion = [&](std::size_t pixel, std::size_t c) {
    return image.aovs[0].values[4 * pixel + c];
  };
  for (const std::size_t pixel : {0, 100, 3071}) {
    EXPECT_NEAR(motion(pixel, 0), 3.2, 1e-5);  // it was further to the right
    EXPECT_NEAR(motion(pixel, 1), 0, 1e-5);
    EXPECT_NEAR(motion(pixel, 2), 0, 1e-5);
    EXPECT_NEAR(motion(pixel, 3), 1.6, 1e-5);  // it will be further down
  }
  for (std::size_t c = 0; c < 4; ++c) {
    EXPECT_NEAR(motion(5, c), 0, 1e-9) << "at infinity only rotations move";
    EXPECT_EQ(motion(7, c), 0) << "nothing is there";
  }
}

TEST(MotionVector, BehindTheCameraThereIsNone) {
  const Vector4d point(0.1, 0, -1, 1);
  const auto motion = motion_vector(camera_at(0, 0, 0), {camera_at(0, 0, -1), camera_at(0, 0, -2)},
                                    {point, point, point});
  for (const float value : motion) EXPECT_EQ(value, 0);
  const Vector4d beside(5, 0, -1e-9, 1);
  const auto far = motion_vector(camera_at(0, 0, 0), {camera_at(0, 0, 0), camera_at(0, 0, 0)},
                                 {beside, point, beside});
  for (const float value : far) EXPECT_EQ(value, 0);
}

}  // namespace
}  // namespace raystage::compose
