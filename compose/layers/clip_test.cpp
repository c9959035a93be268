// SPDX-License-Identifier: Apache-2.0
#include "compose/layers/clip.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <limits>

#include "compose/layers/merge.h"

namespace raystage::compose {
namespace {

using Eigen::Vector3d;
using Eigen::Vector4d;

constexpr int kWidth = 40, kHeight = 20;

render::VirtualCamera camera() {
  rig::Pose pose;
  pose.position = {1, 2, 3};
  pose.world_from_camera_rotation =
      Eigen::AngleAxisd(0.5, Vector3d(0.2, 1, 0.1).normalized()).toRotationMatrix();
  return render::virtual_camera_with_fov(kWidth, kHeight, 1, pose);
}

/// Returns a white image at one depth.
LayerImage wall(float z) {
  LayerImage image = transparent_layer_image(kWidth, kHeight);
  image.rgba.assign(image.pixels() * 4, 1.0F);
  image.z.assign(image.pixels(), z);
  image.aovs.push_back({"lf", {"coverage"}, false, 0, render::PixelValues(image.pixels(), 1.0F)});
  return image;
}

float alpha(const LayerImage& image, int x, int y) { return image.rgba[4 * (y * kWidth + x) + 3]; }

/// Returns a plane through a point in front of the camera that keeps the nearer side.
PlaneClip plane_before(double depth) {
  const render::VirtualCamera view = camera();
  const Vector3d normal = -view.pose.viewing_direction();
  const Vector3d point = view.pose.world_from_camera({0, 0, -depth});
  Vector4d plane;
  plane << 2 * normal, -2 * normal.dot(point);  // of any length
  return {plane, 0};
}

TEST(Clip, APlaneKeepsItsNormalsSide) {
  LayerImage near = wall(3), far = wall(5),
             background = wall(std::numeric_limits<float>::infinity());
  for (LayerImage* image : {&near, &far, &background}) {
    apply({{Clip{plane_before(4)}}}, camera(), *image);
  }
  EXPECT_EQ(alpha(near, 7, 5), 1);
  EXPECT_EQ(near.z[0], 3);
  EXPECT_EQ(alpha(far, 7, 5), 0);
  EXPECT_EQ(far.z[0], std::numeric_limits<float>::infinity());
  EXPECT_EQ(far.aovs[0].values[0], 0);
  EXPECT_EQ(alpha(background, 7, 5), 0);
}

TEST(Clip, FeathersFadeOverTheirWidth) {
  for (const auto& [z, expected] : {std::pair{3.9F, 0.75F}, {4.0F, 0.5F}, {4.15F, 0.125F}}) {
    PlaneClip plane = plane_before(4);
    plane.feather = 0.4;
    LayerImage image = wall(z);
    apply({{Clip{plane}}}, camera(), image);
    EXPECT_NEAR(alpha(image, 20, 10), expected, 1e-5F);
    EXPECT_NEAR(image.rgba[0], expected, 1e-5F) << "premultiplied";
  }
}

TEST(Clip, ABoxKeepsWhatIsInIt) {
  const Vector3d middle = camera().pose.world_from_camera({0, 0, -4});
  const Clip box{BoxClip{middle - Vector3d::Constant(0.5), middle + Vector3d::Constant(0.5)}};
  LayerImage image = wall(4);
  apply({{box}}, camera(), image);
  EXPECT_EQ(alpha(image, kWidth / 2, kHeight / 2), 1);
  EXPECT_EQ(alpha(image, 1, 1), 0);
  image = wall(5);
  apply({{box}}, camera(), image);
  EXPECT_EQ(alpha(image, kWidth / 2, kHeight / 2), 0);
}

TEST(Clip, TwoHalvesOfAPictureLeaveNoSeam) {
  for (const double feather : {0.0, 0.2}) {
    const Clip left{ScreenClip{.right = 0.5, .feather = feather}};
    Clip right = left;
    right.inverted = true;
    LayerImage a = wall(4), b = wall(4);
    apply({{left}}, camera(), a);
    apply({{right}}, camera(), b);
    for (int x = 0; x < kWidth; ++x) EXPECT_NEAR(alpha(a, x, 3) + alpha(b, x, 3), 1, 1e-6F) << x;
    EXPECT_EQ(alpha(a, 0, 0), 1) << "the picture's border does not fade";
    EXPECT_EQ(alpha(b, kWidth - 1, 0), 1);
    EXPECT_EQ(alpha(a, kWidth - 1, 0), 0);
  }
}

TEST(Clip, SeveralMultiply) {
  LayerImage image = wall(4);
  apply({{Clip{ScreenClip{.left = 0.25}}, Clip{ScreenClip{.bottom = 0.5}}}}, camera(), image);
  EXPECT_EQ(alpha(image, 20, 5), 1);
  EXPECT_EQ(alpha(image, 5, 5), 0);
  EXPECT_EQ(alpha(image, 20, 15), 0);
}

TEST(Clip, KnowsWhenNothingCanBeKept) {
  EXPECT_TRUE(keeps_any_pixel({}));
  EXPECT_TRUE(keeps_any_pixel({{Clip{ScreenClip{.left = 0.4, .right = 0.5}}}}));
  EXPECT_FALSE(keeps_any_pixel({{Clip{ScreenClip{.left = 0.5, .right = 0.5}}}}));
  EXPECT_FALSE(keeps_any_pixel({{Clip{ScreenClip{}, true}}}));
  EXPECT_TRUE(keeps_any_pixel({{Clip{PlaneClip{}}}}));
}

}  // namespace
}  // namespace raystage::compose
