// SPDX-License-Identifier: Apache-2.0
#include "render/common/footprint.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>
#include <numeric>

#include "testing/render/synthetic_take.h"

namespace raystage::render {
namespace {

constexpr double kDegree = std::numbers::pi / 180;
const Eigen::Vector4d kPlane(0, 0, 1, 4);

class Footprint : public ::testing::Test {
 protected:
  Footprint() {
    schemas::RigDocument document;
    for (const schemas::CameraGeometry& camera : testing::camera_grid(3, 3, 0.06, 160, 120)) {
      document.cameras.push_back({camera, {}});
    }
    rig_ = rig::rig_from_document(document);
    std::vector<int> all(9);
    std::iota(all.begin(), all.end(), 0);
    instant_.rig = &rig_;
    instant_.present = instant_.complete =
        std::make_shared<const rig::Topology>(rig::make_topology(rig_, all));
  }
  double ratio(int width, double fov, const Eigen::Vector3d& position,
               const Eigen::Vector4d& plane = kPlane) const {
    rig::Pose pose;
    pose.position = position;
    return source_pixels_per_pixel(
        virtual_camera_with_fov(width, width * 3 / 4, fov * kDegree, pose), instant_, plane);
  }
  rig::Rig rig_;
  LightFieldFrame instant_;
};

TEST_F(Footprint, IsTheRatioOfPixelsOnThePlane) {
  EXPECT_NEAR(ratio(160, 62, {0.01, 0.01, 0}), 1, 1e-9);
  EXPECT_NEAR(ratio(40, 62, {0.01, 0.01, 0}), 4, 1e-9);
  EXPECT_NEAR(ratio(640, 62, {0.01, 0.01, 0}), 0.25, 1e-9);
  // At twice the distance from the plane the footprint doubles; at infinity it does not change.
  EXPECT_NEAR(ratio(16, 1, {0.01, 0.01, 4}),
              2 * 10 * std::tan(0.5 * kDegree) / std::tan(31 * kDegree), 1e-9);
  EXPECT_NEAR(ratio(16, 1, {0.01, 0.01, 4}, {0, 0, 0, 1}),
              10 * std::tan(0.5 * kDegree) / std::tan(31 * kDegree), 1e-9);
  EXPECT_EQ(ratio(160, 62, {5, 0, 0}), 0);                   // no camera there
  EXPECT_EQ(ratio(160, 62, {0, 0, 0}, {0, 0, 1, 0}), 0);     // the eye on the plane
  EXPECT_EQ(ratio(160, 62, {0, 0, 0.1}, {0, 0, 1, -2}), 0);  // the plane behind it
}

TEST_F(Footprint, SupersampledViewsSeeTheSameImage) {
  const VirtualCamera view = virtual_camera_with_fov(40, 30, 0.9, {});
  const VirtualCamera fine = supersampled(view, 3);
  EXPECT_EQ(fine.width, 120);
  EXPECT_EQ(fine.height, 90);
  // A pixel's centre is that of its middle sample.
  EXPECT_NEAR((7.5 - view.intrinsics.cx) / view.intrinsics.fx,
              (3 * 7 + 1.5 - fine.intrinsics.cx) / fine.intrinsics.fx, 1e-12);
}

TEST_F(Footprint, AveragesPremultipliedLightAndInverseDepth) {
  RenderedView image;
  image.width = 4;
  image.height = 2;
  image.rgba.assign(32, 0);
  image.coverage.assign(8, 0);
  image.z.assign(8, std::numeric_limits<float>::infinity());
  const auto set = [&](std::size_t pixel, float red, float alpha, float z) {
    image.rgba[pixel * 4] = red;
    image.rgba[pixel * 4 + 3] = alpha;
    image.coverage[pixel] = alpha / 2;
    image.z[pixel] = z;
  };
  set(0, 0.4F, 1, 2);
  set(1, 0.2F, 0.5F, 4);
  image.notes = {"a note"};
  image.cameras = {2, 1, 3, 3, 0, 1, 3, 3};
  image.nearest_ray = {0.3F, 0.2F, 1, 1, 0.5F, 0.6F, 1, 1};
  const RenderedView mean = downsampled(image, 2);
  EXPECT_EQ(mean.cameras, (PixelValues{1, 3}));
  EXPECT_EQ(mean.nearest_ray, (PixelValues{0.2F, 1}));
  ASSERT_EQ(mean.width, 2);
  ASSERT_EQ(mean.height, 1);
  EXPECT_FLOAT_EQ(mean.rgba[0], 0.15F);
  EXPECT_FLOAT_EQ(mean.rgba[3], 0.375F);
  EXPECT_FLOAT_EQ(mean.coverage[0], 0.1875F);
  EXPECT_FLOAT_EQ(mean.z[0], 1.5F / (1 / 2.0F + 0.5F / 4));
  EXPECT_EQ(mean.rgba[7], 0);
  EXPECT_EQ(mean.z[1], std::numeric_limits<float>::infinity());
  EXPECT_EQ(mean.notes, image.notes);
  set(0, 0.4F, 1, std::numeric_limits<float>::infinity());  // a plane at infinity is no hole
  EXPECT_FLOAT_EQ(downsampled(image, 2).z[0], 1.5F / (0.5F / 4));
}

}  // namespace
}  // namespace raystage::render
