// SPDX-License-Identifier: Apache-2.0
#include "rig/plenoptic_sampling.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <numbers>

namespace raystage::rig::plenoptic_sampling_test {
namespace {

constexpr double kInfinity = std::numeric_limits<double>::infinity();

Rig rig_at(const std::vector<Eigen::Vector3d>& centres) {
  schemas::RigDocument document;
  for (std::size_t i = 0; i < centres.size(); ++i) {
    schemas::CameraGeometry camera;
    camera.id = "c" + std::to_string(i);
    camera.width = 320;
    camera.height = 240;
    camera.intrinsics = {266, 266, 160, 120, {}};
    for (int axis = 0; axis < 3; ++axis) {
      camera.world_from_camera[4 * axis + 3] = centres[i][axis];
    }
    document.cameras.push_back({camera, {}});
  }
  return rig_from_document(document);
}

double spacing_of(const std::vector<Eigen::Vector3d>& centres) {
  const Rig rig = rig_at(centres);
  std::vector<int> all;
  for (int i = 0; i < static_cast<int>(centres.size()); ++i) all.push_back(i);
  return max_neighbour_baseline(rig, make_topology(rig, all));
}

TEST(SamplingLimits, TheThesisArrayIsAliasFreeFrom8MetresOn) {
  // Eq. 4.3 and 4.4: 62 degrees, 320 pixels, cameras 6 cm apart.
  const double focal_length = 160 / std::tan(31 * std::numbers::pi / 180);
  EXPECT_NEAR(disparity_range(focal_length, 0.06, {7.99, kInfinity}), kMaxAliasFreeDisparity, 2e-3);
  EXPECT_NEAR(max_alias_free_baseline(focal_length, {7.99, kInfinity}), 0.06, 1e-4);
}

TEST(SamplingLimits, ASceneWithoutDepthHasNoLimit) {
  EXPECT_EQ(disparity_range(300, 0.1, {4, 4}), 0);
  EXPECT_EQ(max_alias_free_baseline(300, {4, 4}), kInfinity);
}

TEST(SamplingLimits, OnePlaneFreesAPixelOfDisparityEitherWay) {
  const double focal_length = 160 / std::tan(31 * std::numbers::pi / 180);
  const double nearest = 0.06 * focal_length / 2;  // eq. 4.3
  const schemas::DepthRange whole = alias_free_depth_range(focal_length, 0.06, 2 * nearest);
  EXPECT_NEAR(whole.near, nearest, 1e-9);
  EXPECT_GT(whole.far, 1e6);
  const schemas::DepthRange wider = alias_free_depth_range(focal_length, 0.12, 2 * nearest);
  EXPECT_NEAR(disparity_range(focal_length, 0.12, wider), kMaxAliasFreeDisparity, 1e-9);
  const schemas::DepthRange alone = alias_free_depth_range(focal_length, 0, 4);
  EXPECT_EQ(alone.near, 0);
  EXPECT_EQ(alone.far, kInfinity);
  EXPECT_EQ(alias_free_depth_range(focal_length, 0.06, kInfinity).far, kInfinity);
}

TEST(SamplingLimits, PlanesAreAsManyAsTheRangeHasPairsOfPixels) {
  EXPECT_EQ(alias_free_plane_count(0), 1);
  EXPECT_EQ(alias_free_plane_count(2), 1);
  EXPECT_EQ(alias_free_plane_count(2.1), 2);
  EXPECT_EQ(alias_free_plane_count(96), 48);
}

TEST(SamplingLimits, SpacingIsAGridsPitchAndNotItsDiagonal) {
  EXPECT_DOUBLE_EQ(spacing_of({{0, 0, 0}, {0.06, 0, 0}, {0, 0.06, 0}, {0.06, 0.06, 0}}), 0.06);
  EXPECT_DOUBLE_EQ(spacing_of({{0, 0, 0}, {0.06, 0, 0}, {0, 0.08, 0}, {0.06, 0.08, 0}}), 0.08);
}

TEST(SamplingLimits, SpacingOfALineAndOfOneCamera) {
  EXPECT_DOUBLE_EQ(spacing_of({{0, 0, 0}, {0.06, 0, 0}, {0.2, 0, 0}}), 0.14);
  EXPECT_EQ(spacing_of({{0, 0, 0}}), 0);
}

}  // namespace
}  // namespace raystage::rig::plenoptic_sampling_test
