// SPDX-License-Identifier: Apache-2.0
// Ranges of motion within arrays that look outwards, against rays that are tested one by one.
#include "planning/outward_coverage.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <limits>
#include <numbers>
#include <random>
#include <vector>

#include "base/error.h"
#include "planning/combined_coverage.h"
#include "planning/complete_topology.h"
#include "planning/coverage_report.h"
#include "planning/recorded_directions.h"
#include "planning/recorded_rays.h"
#include "testing/render/test_poses.h"

namespace raystage::planning::outward_coverage_test {
namespace {

using Eigen::Vector3d;
using ::testing::HasSubstr;
using testing::kDegree;

constexpr double kInfinity = std::numeric_limits<double>::infinity();

/// Returns a camera at `position` whose picture's rows run across `ahead`.
schemas::RigDocument::Camera camera_at(const Vector3d& position, const Vector3d& ahead,
                                       const schemas::Intrinsics& lens, int index) {
  const Vector3d back = -ahead.normalized();
  const Vector3d above = std::abs(back.y()) > 0.9 ? Vector3d::UnitX() : Vector3d::UnitY();
  const Vector3d right = above.cross(back).normalized(), up = back.cross(right);
  schemas::CameraGeometry camera{"c" + std::to_string(index), 200, 200, lens, {}, {}, {}};
  camera.world_from_camera = {
      right.x(), up.x(), back.x(), position.x(), right.y(), up.y(), back.y(), position.y(),
      right.z(), up.z(), back.z(), position.z(), 0,         0,      0,        1};
  return {camera, {}};
}

/// Returns 16 f-theta lenses on a sphere of 0.2 m about `middle`.
rig::Rig sphere_of_fisheyes(double half_angle, const Vector3d& middle = Vector3d::Zero()) {
  schemas::Intrinsics lens{60, 60, 100, 100, {}};
  lens.projection = schemas::Projection::kFtheta;
  lens.half_angle = half_angle;
  schemas::RigDocument document;
  for (int i = 0; i < 16; ++i) {
    const double height = 1 - (i + 0.5) / 8, across = std::sqrt(1 - height * height);
    const double turn = i * std::numbers::pi * (3 - std::sqrt(5.0));
    const Vector3d outwards(across * std::cos(turn), height, across * std::sin(turn));
    document.cameras.push_back(camera_at(middle + 0.2 * outwards, outwards, lens, i));
  }
  return rig::rig_from_document(document);
}

/// Returns pinholes of 100 degrees on a level ring of 0.2 m.
rig::Rig ring_of_pinholes(int count) {
  const double focal = 100 / std::tan(50 * kDegree);
  schemas::RigDocument document;
  for (int i = 0; i < count; ++i) {
    const double turn = 2 * std::numbers::pi * i / count;
    const Vector3d outwards(std::cos(turn), 0, std::sin(turn));
    document.cameras.push_back(
        camera_at(0.2 * outwards, outwards, {focal, focal, 100, 100, {}}, i));
  }
  return rig::rig_from_document(document);
}

/// Returns six sides of four parallel cameras each, around a cube.
rig::Rig box_of_pinholes() {
  schemas::RigDocument document;
  int index = 0;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {1.0, -1.0}) {
      const Vector3d ahead = sign * Vector3d::Unit(axis);
      const Vector3d across = Vector3d::Unit((axis + 1) % 3),
                     along = Vector3d::Unit((axis + 2) % 3);
      for (const double x : {-0.1, 0.1}) {
        for (const double y : {-0.1, 0.1}) {
          document.cameras.push_back(camera_at(0.15 * ahead + x * across + y * along, ahead,
                                               {90, 90, 100, 100, {}}, index++));
        }
      }
    }
  }
  return rig::rig_from_document(document);
}

Vector3d any_position(std::mt19937& random, double size) {
  std::uniform_real_distribution<double> any(-1, 1);
  return size * Vector3d(any(random), any(random), any(random));
}

TEST(UnrecordedDirections, EqualThoseOfSingleRays) {
  std::mt19937 random(7);
  int partial = 0;
  for (const double half_angle : {70 * kDegree, 90 * kDegree}) {
    const rig::Rig rig = sphere_of_fisheyes(half_angle);
    const rig::Topology topology = complete_topology(rig);
    ASSERT_TRUE(topology.outwards);
    for (int round = 0; round < 12; ++round) {
      const Viewpoint from{any_position(random, 0.3), round % 2 == 0 ? kInfinity : 2.0};
      const double share = unrecorded_directions(from, rig, topology);
      EXPECT_NEAR(share, unrecorded_directions_reference(from, rig, topology, 4000), 4e-3)
          << from.position.transpose();
      EXPECT_TRUE(are_directions_recorded(from, rig, topology, 1 - share - 2e-3));
      EXPECT_FALSE(are_directions_recorded(from, rig, topology, 1 - share + 2e-3));
      EXPECT_LE(unseen_directions(from, rig, topology), share + 4e-3);
      partial += share > 0.01 && share < 0.99 ? 1 : 0;
    }
  }
  EXPECT_GT(partial, 6);
}

TEST(UnrecordedDirections, OfARingAreThoseInItsPlane) {
  const rig::Rig rig = ring_of_pinholes(9);
  const rig::Topology topology = complete_topology(rig);
  ASSERT_TRUE(topology.outwards);
  EXPECT_EQ(unrecorded_directions({}, rig, topology), 0);
  std::mt19937 random(8);
  for (int round = 0; round < 12; ++round) {
    Viewpoint from{any_position(random, 0.3), round % 2 == 0 ? kInfinity : 2.0};
    from.position.y() = 0;
    EXPECT_NEAR(unrecorded_directions(from, rig, topology),
                unrecorded_directions_reference(from, rig, topology, 7200), 0.02)
        << from.position.transpose();
  }
}

TEST(UnrecordedShare, OfASphereEqualsTheCountOfPixels) {
  const rig::Rig rig = sphere_of_fisheyes(80 * kDegree);
  const rig::Topology topology = complete_topology(rig);
  std::mt19937 random(9);
  for (int round = 0; round < 12; ++round) {
    const render::VirtualCamera view = render::virtual_camera_with_fov(
        320, 240, 70 * kDegree,
        testing::make_pose(any_position(random, 0.25), 30.0 * round, 10.0 * (round % 5)));
    const Eigen::Vector4d plane = rig::fronto_parallel_plane(rig, round % 2 == 0 ? kInfinity : 2.0,
                                                             view.pose.viewing_direction());
    EXPECT_NEAR(unrecorded_share(view, rig, topology, plane),
                unrecorded_share_reference(view, rig, topology, plane), 4e-3);
  }
}

TEST(IsOutwardArray, SpheresAndRingsButNotBoxes) {
  EXPECT_TRUE(is_outward_array(sphere_of_fisheyes(90 * kDegree)));
  EXPECT_TRUE(is_outward_array(ring_of_pinholes(9)));
  EXPECT_FALSE(is_outward_array(box_of_pinholes()));
  EXPECT_EQ(split_by_direction({"box", box_of_pinholes()}).size(), 6U);
  EXPECT_EQ(split_by_direction({"ring", ring_of_pinholes(9)}).size(), 1U);
}

/// Checks that a volume ends where rays are missing: just inside all were recorded.
template <class Missing>
void expect_border(const CoveragePlan& plan, const CoverageVolume& volume, const Missing& missing) {
  ASSERT_FALSE(volume.surface.vertices.empty()) << volume.empty_because;
  EXPECT_FALSE(volume.is_exact);
  Vector3d centre = Vector3d::Zero();
  for (const Vector3d& vertex : volume.surface.vertices) {
    centre += vertex / static_cast<double>(volume.surface.vertices.size());
  }
  const std::size_t step = volume.surface.vertices.size() / 25 + 1;
  for (std::size_t i = 0; i < volume.surface.vertices.size(); i += step) {
    const Vector3d& vertex = volume.surface.vertices[i];
    if ((vertex - centre).norm() < 0.01) continue;  // the middle of a flat range
    const auto at = [&](double part) {
      return missing(plan.array.world_from_camera(centre + part * (vertex - centre)));
    };
    EXPECT_LE(at(0.93), 1 - volume.share + 1e-3) << vertex.transpose();
    EXPECT_GT(at(1.07), 1 - volume.share) << vertex.transpose();
  }
}

TEST(OutwardCoverage, OfAllDirectionsIsWithinTheSphere) {
  const Vector3d middle(1, 2, 3);
  const rig::Rig rig = sphere_of_fisheyes(90 * kDegree, middle);
  const rig::Topology topology = complete_topology(rig);
  CoverageOptions options;
  options.all_directions = true;
  options.shares = {1, 0.95};
  options.tolerance_m = 1e-2;
  const CoveragePlan plan = plan_coverage("sphere", rig, options);
  EXPECT_TRUE(plan.looks_around);
  EXPECT_LT((plan.array.position - middle).norm(), 0.02);
  ASSERT_EQ(plan.volumes.size(), 2U);
  for (const CoverageVolume& volume : plan.volumes) {
    expect_border(plan, volume, [&](const Vector3d& position) {
      return unrecorded_directions({position}, rig, topology);
    });
  }
  EXPECT_GT(plan.volumes[1].surface.volume(), plan.volumes[0].surface.volume());
  for (const Vector3d& vertex : plan.volumes[0].surface.vertices) EXPECT_LT(vertex.norm(), 0.25);
  const std::string text = format_coverage_plan(plan);
  EXPECT_THAT(text, HasSubstr("The cameras look around"));
  EXPECT_THAT(text, HasSubstr("all directions"));
  EXPECT_THAT(coverage_plan_as_json(plan), HasSubstr("\"looks_around\""));
}

TEST(OutwardCoverage, OfViewsOfASphere) {
  const rig::Rig rig = sphere_of_fisheyes(90 * kDegree);
  const rig::Topology topology = complete_topology(rig);
  CoverageOptions options;
  options.view_fov_deg = {50};
  options.shares = {1};
  options.yaw_deg = 40;
  options.tolerance_m = 1e-2;
  const CoveragePlan plan = plan_coverage("sphere", rig, options);
  ASSERT_EQ(plan.volumes.size(), 1U);
  expect_border(plan, plan.volumes[0], [&](const Vector3d& position) {
    render::VirtualCamera view = render::virtual_camera_with_fov(1024, 768, 50 * kDegree, {});
    view.pose = {plan.array.world_from_camera_rotation *
                     Eigen::AngleAxisd(40 * kDegree, Vector3d::UnitY()).toRotationMatrix(),
                 position};
    return unrecorded_share(view, rig, topology, {0, 0, 0, 1});
  });
  // Behind the middle there is more room than ahead of it.
  EXPECT_GT(plan.volumes[0].extent().maxCoeff(), 0.2);
}

TEST(OutwardCoverage, OfARingIsFlat) {
  const rig::Rig rig = ring_of_pinholes(9);
  const rig::Topology topology = complete_topology(rig);
  CoverageOptions options;
  options.all_directions = true;
  options.shares = {1};
  const CoveragePlan plan = plan_coverage("ring", rig, options);
  ASSERT_EQ(plan.volumes.size(), 1U);
  for (const Vector3d& vertex : plan.volumes[0].surface.vertices) EXPECT_EQ(vertex.y(), 0);
  EXPECT_GT(plan.volumes[0].extent().x(), 0.05);
  expect_border(plan, plan.volumes[0], [&](const Vector3d& position) {
    return unrecorded_directions({position}, rig, topology);
  });
  options.all_directions = false;
  options.pitch_deg = 20;
  EXPECT_THAT(plan_coverage("ring", rig, options).volumes[0].empty_because, HasSubstr("plane"));
}

TEST(OutwardCoverage, OfASubjectGoesOnBehindTheArray) {
  const rig::Rig rig = sphere_of_fisheyes(90 * kDegree);
  const CoveragePlan plan = plan_subject_coverage("sphere", rig, {0, 0, -3}, 0.05);
  ASSERT_EQ(plan.volumes.size(), 1U);
  const CoverageVolume& volume = plan.volumes[0];
  EXPECT_TRUE(volume.is_of_subject);
  ASSERT_FALSE(volume.surface.vertices.empty()) << volume.empty_because;
  EXPECT_TRUE(volume.cut_off_m);
  EXPECT_THAT(format_coverage_plan(plan), HasSubstr("from the middle of the array"));
}

TEST(OutwardCoverage, IsOfOneArray) {
  const std::vector<NamedRig> arrays{{"sphere", sphere_of_fisheyes(90 * kDegree)},
                                     {"ring", ring_of_pinholes(9)}};
  const auto refusal = [](const auto& compute) -> std::string {
    try {
      compute();
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  EXPECT_THAT(refusal([&] { plan_combined_coverage("both", arrays, {}); }),
              HasSubstr("planned alone"));
  CoverageOptions options;
  options.all_directions = true;
  options.interaxial_m = 0.06;
  EXPECT_THAT(refusal([&] { plan_coverage("sphere", arrays[0].rig, options); }),
              HasSubstr("one eye"));
}

/// Returns five cameras that look outwards and upwards from a dome, turned about the vertical.
rig::Rig dome(double turn) {
  schemas::RigDocument document;
  for (int i = 0; i < 5; ++i) {
    const double yaw = turn + (i - 2) * 30 * kDegree, pitch = (i % 2 == 0 ? 20 : 60) * kDegree;
    const Vector3d outwards(std::cos(pitch) * std::sin(yaw), std::sin(pitch),
                            -std::cos(pitch) * std::cos(yaw));
    document.cameras.push_back(camera_at(0.2 * outwards, outwards, {60, 60, 100, 100, {}}, i));
  }
  return rig::rig_from_document(document);
}

TEST(OutwardFrame, OfADomeIsLevelWhereverItLooks) {
  for (const double turn : {0.0, 90.0, 170.0, 180.0, -75.0}) {
    const rig::Rig rig = dome(turn * kDegree);
    const Eigen::Matrix3d frame =
        outward_frame(rig, complete_topology(rig)).world_from_camera_rotation;
    EXPECT_NEAR(frame(1, 0), 0, 1e-12) << "x is level";
    EXPECT_GT(frame(1, 1), 0) << "y is up";
    EXPECT_NEAR(frame.determinant(), 1, 1e-12);
    const Eigen::Matrix3d turned =
        Eigen::AngleAxisd(-turn * kDegree, Vector3d::UnitY()).toRotationMatrix() *
        outward_frame(dome(0), complete_topology(dome(0))).world_from_camera_rotation;
    EXPECT_LT((frame - turned).norm(), 1e-9) << "as that of the dome, turned";
  }
}

TEST(OutwardCoverage, OfViewsThatLookBackIsPlannedForOutwardArraysOnly) {
  CoverageOptions options;
  options.view_fov_deg = {30};
  options.shares = {0.9};
  options.yaw_deg = 150;
  options.tolerance_m = 0.05;
  const CoveragePlan plan = plan_coverage("sphere", sphere_of_fisheyes(90 * kDegree), options);
  EXPECT_FALSE(plan.volumes[0].surface.vertices.empty()) << plan.volumes[0].empty_because;
}

}  // namespace
}  // namespace raystage::planning::outward_coverage_test
