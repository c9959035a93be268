// SPDX-License-Identifier: Apache-2.0
#include "planning/combined_coverage.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <nlohmann/json.hpp>
#include <numbers>
#include <random>

#include "base/error.h"
#include "planning/coverage_report.h"
#include "testing/render/synthetic_take.h"
#include "testing/render/test_poses.h"

namespace raystage::planning::combined_coverage_test {
namespace {

using Eigen::Vector3d;
using ::testing::HasSubstr;
using testing::kDegree;

/// A square array of 3x3 cameras whose middle is `distance` in front of the world's origin, turned
/// about that.
NamedRig side(const Eigen::Matrix3d& rotation, double distance, double size, double fov_deg,
              const schemas::Distortion& distortion = {}) {
  constexpr int kPixels = 480;
  schemas::RigDocument document;
  for (auto camera : testing::camera_grid(3, 3, size / 2, kPixels, kPixels, distortion)) {
    camera.intrinsics.fx = camera.intrinsics.fy = kPixels / 2.0 / std::tan(fov_deg / 2 * kDegree);
    camera.intrinsics.cx = camera.intrinsics.cy = kPixels / 2.0;
    document.cameras.push_back({camera, {}});
  }
  NamedRig named{"side", rig::rig_from_document(document)};
  const Vector3d middle = named.rig.centre();
  for (rig::Rig::Camera& camera : named.rig.cameras) {
    camera.pose.position =
        rotation * (camera.pose.position - middle - distance * Vector3d::UnitZ());
    camera.pose.world_from_camera_rotation = rotation * camera.pose.world_from_camera_rotation;
  }
  return named;
}

std::vector<NamedRig> box(double edge, double size, double fov_deg) {
  std::vector<NamedRig> sides;
  for (int quarter = 0; quarter < 4; ++quarter) {
    sides.push_back(side(Eigen::AngleAxisd(quarter * 90 * kDegree, Vector3d::UnitY()).matrix(),
                         edge / 2, size, fov_deg));
  }
  for (const double pitch : {90.0, -90.0}) {
    sides.push_back(side(Eigen::AngleAxisd(pitch * kDegree, Vector3d::UnitX()).matrix(), edge / 2,
                         size, fov_deg));
  }
  return sides;
}

NamedRig together(const std::vector<NamedRig>& rigs) {
  NamedRig all{"all", rigs[0].rig};
  all.rig.topology_kind = "auto";
  for (std::size_t i = 1; i < rigs.size(); ++i) {
    all.rig.cameras.insert(all.rig.cameras.end(), rigs[i].rig.cameras.begin(),
                           rigs[i].rig.cameras.end());
  }
  return all;
}

CoverageOptions all_around(bool hide) {
  CoverageOptions options;
  options.all_directions = true;
  options.shares = {1};
  options.arrays_hide_each_other = hide;
  return options;
}

// Thesis figure 6-8: the range of the extended box is the rhombic dodecahedron of 2 l^3.
TEST(CombinedCoverage, OfTheExtendedBox) {
  const double l = 0.3;
  const std::vector<NamedRig> sides = split_by_direction(together(box(l, 3 * l, 90)));
  ASSERT_EQ(sides.size(), 6U);
  for (const NamedRig& one : sides) EXPECT_EQ(one.rig.cameras.size(), 9U);
  const CoveragePlan plan = plan_combined_coverage("box", sides, all_around(false));
  ASSERT_EQ(plan.volumes.size(), 1U);
  const CoverageVolume& volume = plan.volumes[0];
  EXPECT_LE(volume.error_m, 1e-3);
  EXPECT_NEAR(volume.surface.volume(), 2 * l * l * l, 0.01 * 2 * l * l * l);
  EXPECT_LT((volume.extent() - Vector3d::Constant(2 * l)).norm(), 2e-3);
  for (const Vector3d& vertex : volume.surface.vertices) {
    const Vector3d a = vertex.cwiseAbs();
    EXPECT_NEAR(std::max({a.x() + a.y(), a.y() + a.z(), a.z() + a.x()}), l, 1e-3);
  }
  EXPECT_THAT(format_coverage_plan(plan), HasSubstr("all, side 6: 9 cameras, 0.900 x 0.900 m"));

  // As real arrays, they hide each other, and no position has all rays.
  CoverageOptions real = all_around(true);
  real.subject = CoverageSubject{0.75 * l, 0.75 * l, 0, 0.1 * l};
  const CoveragePlan hidden = plan_combined_coverage("box", sides, real);
  EXPECT_TRUE(hidden.volumes[0].surface.vertices.empty());
  EXPECT_THAT(hidden.volumes[0].empty_because, HasSubstr("no position was found"));
  ASSERT_TRUE(hidden.subject_view);
  EXPECT_EQ(hidden.subject_view->arrays, 2);
  const auto json = nlohmann::json::parse(coverage_plan_as_json(hidden));
  EXPECT_EQ(json["arrays"].size(), 6U);
  EXPECT_EQ(json["subject"]["arrays"], 2);
  EXPECT_THAT(coverage_plan_as_page(hidden), HasSubstr("by 2 arrays"));
}

TEST(CombinedCoverage, OfTheSimpleCubeIsItsCentre) {
  const CoveragePlan plan = plan_combined_coverage("cube", box(0.4, 0.4, 90), all_around(true));
  EXPECT_THAT(plan.volumes[0].empty_because,
              HasSubstr("thinner than the tolerance, around (0.000, "));
  // A wider field of view gives room.
  const CoveragePlan wide = plan_combined_coverage("cube", box(0.4, 0.4, 110), all_around(true));
  const double slope = std::tan(55 * kDegree), limit = (slope - 1) * 0.2;
  ASSERT_FALSE(wide.volumes[0].surface.vertices.empty());
  for (const Vector3d& vertex : wide.volumes[0].surface.vertices) {
    Vector3d a = vertex.cwiseAbs();
    std::ranges::sort(a, std::greater<>());
    EXPECT_NEAR(slope * a[0] + a[1], limit, 2e-3);
  }
}

// One array alone has the range that is known in closed form.
TEST(CombinedCoverage, OfOneArrayIsItsOwn) {
  const std::vector<NamedRig> one{side(Eigen::Matrix3d::Identity(), 0, 0.4, 60)};
  CoverageOptions options;
  options.view_fov_deg = {40};
  options.shares = {1};
  options.interaxial_m = 0.02;
  options.max_yaw_deg = 5;
  const CoveragePlan combined = plan_combined_coverage("one", one, options);
  const CoveragePlan exact = plan_coverage("one", one[0].rig, options);
  EXPECT_TRUE(exact.volumes[0].is_exact);
  EXPECT_NEAR(combined.volumes[0].surface.volume(), exact.volumes[0].surface.volume(),
              0.01 * exact.volumes[0].surface.volume());
  EXPECT_LT((combined.volumes[0].extent() - exact.volumes[0].extent()).norm(), 4e-3);
}

// Cameras with lens distortion count with what they see.
TEST(CombinedCoverage, OfRealArrays) {
  std::vector<NamedRig> sides;
  for (int quarter = 0; quarter < 2; ++quarter) {
    sides.push_back(side(Eigen::AngleAxisd(quarter * 50 * kDegree, Vector3d::UnitY()).matrix(), 0.3,
                         0.4, 80, {-0.05, 0.01, 0, 0, 0}));
  }
  CoverageOptions options;
  options.view_fov_deg = {60};
  options.shares = {1, 0.9};
  options.tolerance_m = 4e-3;
  options.yaw_deg = 25;  // between the two
  const CoveragePlan plan = plan_combined_coverage("two", sides, options);
  for (const CoverageVolume& volume : plan.volumes) EXPECT_FALSE(volume.is_lower_bound);
  EXPECT_GT(plan.volumes[1].surface.volume(), plan.volumes[0].surface.volume());
  EXPECT_THAT(format_coverage_plan(plan), HasSubstr("(at least)"));
}

/// 4 x 4 cameras that are toed in by up to 12 degrees, distorted, and nowhere quite in place.
NamedRig real_array(std::mt19937& random, double x_m, double yaw_deg) {
  std::uniform_real_distribution<double> any(-1, 1);
  schemas::RigDocument document;
  for (const auto& camera : testing::camera_grid(4, 4, 0.06, 640, 480, {-0.15, 0.03, 0, 0, 0})) {
    document.cameras.push_back({camera, {}});
  }
  NamedRig named{"real", rig::rig_from_document(document)};
  const Eigen::Matrix3d turned = Eigen::AngleAxisd(yaw_deg * kDegree, Vector3d::UnitY()).matrix();
  const Vector3d middle = named.rig.centre();
  for (rig::Rig::Camera& camera : named.rig.cameras) {
    const Vector3d at = camera.pose.position - middle;
    camera.pose.position = Vector3d(x_m, 0, 0) +
                           turned * (at + 0.004 * Vector3d(any(random), any(random), any(random)));
    camera.pose.world_from_camera_rotation =
        turned * testing::make_pose(Vector3d::Zero(), 130 * at.x(), 3 * any(random))
                     .world_from_camera_rotation;
  }
  return named;
}

// One real array among several has the range that it has alone.
TEST(CombinedCoverage, OfOneRealArrayIsItsOwn) {
  std::mt19937 random(3);
  const std::vector<NamedRig> one{real_array(random, 0, 10)};
  CoverageOptions options;
  options.view_fov_deg = {25};
  options.shares = {1, 0.9};
  const CoveragePlan combined = plan_combined_coverage("one", one, options);
  const CoveragePlan alone = plan_coverage("one", one[0].rig, options);
  for (std::size_t i = 0; i < 2; ++i) {
    ASSERT_FALSE(alone.volumes[i].surface.vertices.empty());
    EXPECT_LE(combined.volumes[i].error_m, 1e-3);
    EXPECT_NEAR(combined.volumes[i].surface.volume() / alone.volumes[i].surface.volume(), 1, 0.03);
    EXPECT_LT((combined.volumes[i].extent() - alone.volumes[i].extent()).cwiseAbs().maxCoeff(),
              4e-3);
  }
}

// Between two arrays with a gap nothing was recorded.
TEST(CombinedCoverage, StatesThatPartsAreApart) {
  std::vector<NamedRig> arrays;
  for (int i = 0; i < 2; ++i) {
    arrays.push_back(side(Eigen::Matrix3d::Identity(), 0, 0.4, 60));
    for (rig::Rig::Camera& camera : arrays.back().rig.cameras) camera.pose.position.x() += 0.8 * i;
  }
  CoverageOptions options;
  options.view_fov_deg = {40};
  options.shares = {1};
  options.tolerance_m = 4e-3;
  CoveragePlan plan = plan_combined_coverage("gap", arrays, options);
  EXPECT_TRUE(plan.volumes[0].is_in_parts);
  EXPECT_NEAR(plan.volumes[0].extent().x(), 0.4, 4e-3);
  EXPECT_THAT(format_coverage_plan(plan), HasSubstr("one part"));
  for (rig::Rig::Camera& camera : arrays[1].rig.cameras) camera.pose.position.x() -= 0.4;
  plan = plan_combined_coverage("no gap", arrays, options);
  EXPECT_FALSE(plan.volumes[0].is_in_parts);
  EXPECT_NEAR(plan.volumes[0].extent().x(), 0.8, 8e-3);
}

// Orientations between the ends of the yaw count, arrays far apart are found, and narrow views are
// far from their array.
TEST(CombinedCoverage, TriesOrientationsAndReachesFar) {
  std::vector<NamedRig> fan;
  for (const double yaw : {-75.0, 0.0, 75.0}) {
    fan.push_back(side(Eigen::AngleAxisd(yaw * kDegree, Vector3d::UnitY()).matrix(), 0.1, 0.4, 60));
  }
  CoverageOptions options;
  options.view_fov_deg = {20};
  options.shares = {1};
  options.tolerance_m = 0.01;
  EXPECT_FALSE(plan_combined_coverage("fan", fan, options).volumes[0].surface.vertices.empty());
  options.max_yaw_deg = 75;
  EXPECT_TRUE(plan_combined_coverage("fan", fan, options).volumes[0].surface.vertices.empty())
      << "between the arrays, views look where no camera looks";

  std::vector<NamedRig> apart(2, side(Eigen::Matrix3d::Identity(), 0, 0.4, 60));
  for (rig::Rig::Camera& camera : apart[1].rig.cameras) camera.pose.position.x() += 10;
  options.max_yaw_deg = 0;
  const CoverageVolume found = plan_combined_coverage("apart", apart, options).volumes[0];
  EXPECT_NEAR(found.extent().x(), 0.4, 0.03);
  EXPECT_TRUE(found.is_in_parts);

  options.view_fov_deg = {4};
  std::vector<NamedRig> twice(2, side(Eigen::Matrix3d::Identity(), 0, 0.4, 60));
  for (rig::Rig::Camera& camera : twice[1].rig.cameras) camera.pose.position.x() += 1e-6;
  const CoverageVolume narrow = plan_combined_coverage("twice", twice, options).volumes[0];
  const CoverageVolume exact = plan_coverage("one", twice[0].rig, options).volumes[0];
  EXPECT_NEAR(narrow.extent().z(), exact.extent().z(), 0.05 * exact.extent().z());
}

TEST(CombinedCoverage, ManyArraysAndRoundOnesAreBounded) {
  const std::vector<NamedRig> many(65, side(Eigen::Matrix3d::Identity(), 0, 0.4, 60));
  EXPECT_THROW(plan_combined_coverage("many", many, {}), Error);
  // 500 cameras in a circle: outlines have 64 corners at most, and the range is hardly smaller.
  NamedRig ring = side(Eigen::Matrix3d::Identity(), 0, 0.4, 60);
  const rig::Rig::Camera camera = ring.rig.cameras[0];
  ring.rig.cameras.clear();
  constexpr int kCameras = 500;
  for (int i = 0; i < kCameras; ++i) {
    const double angle = 2 * std::numbers::pi * i / kCameras;
    ring.rig.cameras.push_back(camera);
    ring.rig.cameras.back().pose.position = {0.2 * std::cos(angle), 0.2 * std::sin(angle), 0};
    ring.rig.cameras.back().row = ring.rig.cameras.back().column = std::nullopt;
  }
  CoverageOptions options;
  options.view_fov_deg = {40};
  options.shares = {1};
  options.tolerance_m = 4e-3;
  const CoverageVolume found =
      plan_combined_coverage("ring", std::vector{ring}, options).volumes[0];
  EXPECT_NEAR(found.extent().x(), 0.4, 0.01);
}

TEST(CombinedCoverage, Refusals) {
  const std::vector<NamedRig> one{side(Eigen::Matrix3d::Identity(), 0, 0.4, 60)};
  CoverageOptions options;
  options.focal_depth_m = 3;
  EXPECT_THROW(plan_combined_coverage("one", one, options), Error);
  options = all_around(true);
  options.interaxial_m = 0.06;
  EXPECT_THROW(plan_combined_coverage("one", one, options), Error);
  EXPECT_THROW(plan_combined_coverage("none", {}, {}), Error);
  EXPECT_THROW(plan_combined_coverage("the same twice", std::vector{one[0], one[0]}, {}), Error);
  NamedRig row = one[0];
  row.rig.cameras.erase(row.rig.cameras.begin() + 3, row.rig.cameras.end());
  EXPECT_THROW(plan_combined_coverage("row", std::vector{row}, {}), Error);
  std::stop_source stop;
  stop.request_stop();
  EXPECT_THROW(plan_combined_coverage("one", one, all_around(false), {}, stop.get_token()), Error);
}

}  // namespace
}  // namespace raystage::planning::combined_coverage_test
