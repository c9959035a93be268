// SPDX-License-Identifier: Apache-2.0
#include "planning/coverage_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>
#include <nlohmann/json.hpp>
#include <numbers>
#include <optional>
#include <random>

#include "base/error.h"
#include "compose/camera/gltf_file.h"
#include "planning/complete_topology.h"
#include "planning/coverage_report.h"
#include "planning/radial_surface.h"
#include "planning/recorded_rays.h"
#include "rig/planning/range_of_motion.h"
#include "rig/planning/wall_eyed_array.h"
#include "testing/render/synthetic_take.h"
#include "testing/render/test_poses.h"

namespace raystage::planning::coverage_plan_test {
namespace {

using Eigen::Vector3d;
using ::testing::HasSubstr;
using testing::kDegree;
using ::testing::Not;

rig::Rig grid_rig(int rows, int columns, const schemas::Distortion& distortion = {}) {
  schemas::RigDocument document;
  for (const auto& camera : testing::camera_grid(rows, columns, 0.06, 640, 480, distortion)) {
    document.cameras.push_back({camera, {}});
  }
  return rig::rig_from_document(document);
}

Vector3d random_direction(std::mt19937& random) {
  std::normal_distribution<double> any;
  return Vector3d(any(random), any(random), any(random)).normalized();
}

/// Returns the distance at which a ray from `centre` meets a surface first, or nullopt.
std::optional<double> distance_to(const ClosedSurface& surface, const Vector3d& centre,
                                  const Vector3d& direction) {
  std::optional<double> nearest;
  for (const auto& t : surface.triangles) {
    Eigen::Matrix3d sides;
    sides << surface.vertices[t[1]] - surface.vertices[t[0]],
        surface.vertices[t[2]] - surface.vertices[t[0]], -direction;
    if (std::abs(sides.determinant()) < 1e-18) continue;
    const Vector3d s = sides.inverse() * (centre - surface.vertices[t[0]]);
    if (s.x() < -1e-9 || s.y() < -1e-9 || s.x() + s.y() > 1 + 1e-9 || s.z() < 0) continue;
    if (!nearest || s.z() < *nearest) nearest = s.z();
  }
  return nearest;
}

/// Returns whether every side of a triangle belongs to one other triangle, in the other direction.
bool is_closed(const ClosedSurface& surface) {
  std::vector<std::pair<int, int>> sides;
  for (const auto& t : surface.triangles) {
    for (std::size_t i = 0; i < 3; ++i) sides.emplace_back(t[i], t[(i + 1) % 3]);
  }
  std::ranges::sort(sides);
  if (std::ranges::adjacent_find(sides) != sides.end()) return false;
  return std::ranges::all_of(sides, [&](const auto& side) {
    return std::ranges::binary_search(sides, std::pair(side.second, side.first));
  });
}

TEST(RadialSurface, OfABallAndABox) {
  const Vector3d centre(0.1, 0.2, -0.3);
  const RadialSurface ball =
      radial_surface([&](const Vector3d& p) { return (p - Vector3d::Zero()).norm() <= 1; }, centre,
                     {.reach = 3, .tolerance = 1e-3});
  EXPECT_TRUE(is_closed(ball.surface));
  EXPECT_LE(ball.error, 1e-3);
  EXPECT_NEAR(ball.surface.volume(), 4 * std::numbers::pi / 3, 0.01);
  for (const Vector3d& vertex : ball.surface.vertices) EXPECT_NEAR(vertex.norm(), 1, 1e-3);

  const RadialSurface box =
      radial_surface([&](const Vector3d& p) { return p.cwiseAbs().maxCoeff() <= 0.5; }, centre,
                     {.reach = 3, .tolerance = 1e-3});
  EXPECT_TRUE(is_closed(box.surface));
  EXPECT_NEAR(box.surface.volume(), 1, 2e-3);
  const RadialSurface rough =
      radial_surface([&](const Vector3d& p) { return p.cwiseAbs().maxCoeff() <= 0.5; }, centre,
                     {.reach = 3, .tolerance = 1e-3, .max_vertices = 700});
  EXPECT_LE(rough.surface.vertices.size(), 700U);
  EXPECT_GT(rough.error, 1e-3) << "it states what it did not reach";
}

// Thesis 5.2.1: with the cameras' own field of view the range is as deep as the array is wide, over
// twice the tangent, to both sides.
TEST(CoveragePlan, OfAnIdealArrayIsExact) {
  const rig::Rig rig = grid_rig(5, 5);
  CoverageOptions options;
  options.view_fov_deg = {40};
  options.aspect = 1;
  options.shares = {1};
  const CoveragePlan plan = plan_coverage("grid", rig, options);
  ASSERT_EQ(plan.volumes.size(), 1U);
  const CoverageVolume& volume = plan.volumes[0];
  EXPECT_TRUE(volume.is_exact);
  EXPECT_TRUE(is_closed(volume.surface));
  const double depth = 0.24 / std::tan(20 * kDegree);
  EXPECT_LT((volume.extent() - Vector3d(0.24, 0.24, depth)).norm(), 1e-9);
  EXPECT_NEAR(volume.surface.volume(), 0.24 * 0.24 * depth / 3, 1e-9);
  // A view that turns needs both ends of its rotation.
  options.max_yaw_deg = 5;
  const CoveragePlan turning = plan_coverage("grid", rig, options);
  EXPECT_TRUE(turning.volumes[0].is_exact);
  EXPECT_LT(turning.volumes[0].surface.volume(), volume.surface.volume());
  EXPECT_GT(turning.volumes[0].surface.volume(), 0.3 * volume.surface.volume());
}

TEST(CoveragePlan, OfAFamilyIsNested) {
  CoverageOptions options;
  options.view_fov_deg = {30, 50};
  options.tolerance_m = 4e-3;
  const CoveragePlan plan = plan_coverage("grid", grid_rig(4, 4), options);
  ASSERT_EQ(plan.volumes.size(), 6U);
  for (std::size_t i = 0; i + 1 < plan.volumes.size(); ++i) {
    const CoverageVolume &a = plan.volumes[i], &b = plan.volumes[i + 1];
    if (a.view_fov_deg != b.view_fov_deg) continue;
    EXPECT_GT(a.share, b.share);
    EXPECT_LT(a.surface.volume(), b.surface.volume());
    EXPECT_FALSE(b.is_exact);
  }
  EXPECT_GT(plan.volumes[0].surface.volume(), plan.volumes[3].surface.volume());
}

// The measured surface of an ideal array is that of the closed form.
TEST(CoveragePlan, TheMeasuredSurfaceIsTheExactOne) {
  const rig::Rig rig = grid_rig(5, 5);
  const auto ideal = rig::find_wall_eyed_array(rig);
  ASSERT_TRUE(ideal);
  const rig::Topology topology = complete_topology(rig);
  const render::VirtualCamera front = render::virtual_camera_with_fov(640, 480, 40 * kDegree, {});
  const rig::RangeOfMotion range = rig::range_of_motion(
      *ideal, {rig::camera_slopes(front.intrinsics, front.width, front.height)});
  const auto is_inside = [&](const Vector3d& p) {
    render::VirtualCamera view = front;
    view.pose.position = ideal->pose.world_from_camera(p);
    return unrecorded_share(view, rig, topology, {0, 0, 0, 1}) == 0;
  };
  const RadialSurface measured =
      radial_surface(is_inside, Vector3d::Zero(), {.reach = 1, .tolerance = 1e-3});
  EXPECT_LE(measured.error, 1e-3);
  EXPECT_TRUE(is_closed(measured.surface));
  for (const Vector3d& vertex : measured.surface.vertices) {
    EXPECT_NEAR(range.positions.signed_distance(vertex), 0, 2e-4);
  }
  EXPECT_NEAR(measured.surface.volume(), range.positions.volume(), 0.01 * range.positions.volume());
}

// Between its vertices the surface of a real array is where tracing says, within what it states.
TEST(CoveragePlan, OfARealArrayIsWhereRaysEnd) {
  std::mt19937 random(3);
  std::uniform_real_distribution<double> any(-1, 1);
  rig::Rig rig = grid_rig(4, 4, {-0.15, 0.03, 0, 0, 0});
  for (rig::Rig::Camera& camera : rig.cameras) {
    camera.pose.position += 0.004 * Vector3d(any(random), any(random), any(random));
    camera.pose.world_from_camera_rotation =
        testing::make_pose(Vector3d::Zero(), 3 * any(random), 2 * any(random))
            .world_from_camera_rotation;
  }
  CoverageOptions options;
  options.view_fov_deg = {35};
  options.shares = {1, 0.95};
  options.tolerance_m = 2e-3;
  const CoveragePlan plan = plan_coverage("real", rig, options);
  const rig::Topology topology = complete_topology(rig);
  const render::VirtualCamera front = render::virtual_camera_with_fov(1024, 768, 35 * kDegree, {});
  for (const CoverageVolume& volume : plan.volumes) {
    EXPECT_FALSE(volume.is_exact);
    EXPECT_TRUE(is_closed(volume.surface));
    EXPECT_LE(volume.error_m, 2e-3);
    const auto is_inside = [&](const Vector3d& p) {
      render::VirtualCamera view = front;
      view.pose.position = plan.array.world_from_camera(p);
      view.pose.world_from_camera_rotation = plan.array.world_from_camera_rotation;
      return 1 - unrecorded_share(view, rig, topology, {0, 0, 0, 1}) >= volume.share - 1e-12;
    };
    ASSERT_TRUE(is_inside(Vector3d::Zero()));
    double worst = 0;
    for (int i = 0; i < 300; ++i) {
      const Vector3d direction = random_direction(random);
      const auto end = distance_to(volume.surface, Vector3d::Zero(), direction);
      ASSERT_TRUE(end);
      // The border along the direction, by bisection around the surface.
      double low = 0, high = 2 * *end;
      while (high - low > 1e-5) {
        const double middle = (low + high) / 2;
        (is_inside(middle * direction) ? low : high) = middle;
      }
      // Along the normal it is nearer than along the direction.
      worst = std::max(worst, std::abs(low - *end));
    }
    EXPECT_LT(worst, 0.02);
  }
}

TEST(CoveragePlan, ReportsHoldTheSameNumbers) {
  CoverageOptions options;
  options.view_fov_deg = {40, 100};
  options.shares = {1};
  rig::Rig rig = grid_rig(3, 3);
  const CoveragePlan plan = plan_coverage("<b>grid</b>", rig, options);
  const std::string text = format_coverage_plan(plan);
  EXPECT_THAT(text, HasSubstr("9 cameras"));
  EXPECT_THAT(text, HasSubstr("40 deg    100 %  0.120 x 0.120 x"));
  EXPECT_THAT(text, HasSubstr("which no camera sees"));
  const auto json = nlohmann::json::parse(coverage_plan_as_json(plan));
  EXPECT_EQ(json.at("schema"), "raystage/coverage_plan/1");
  EXPECT_TRUE(json.at("focal_depth_m").is_null());
  ASSERT_EQ(json.at("volumes").size(), 2U);
  EXPECT_TRUE(json.at("volumes")[0].at("is_exact"));
  EXPECT_TRUE(json.at("volumes")[1].contains("empty_because"));
  const std::string page = coverage_plan_as_page(plan);
  EXPECT_THAT(page, HasSubstr("<polygon class=\"volume fov0 whole\""));
  EXPECT_THAT(page, Not(HasSubstr("<b>grid")));

  const compose::GltfFile gltf(coverage_plan_as_gltf(plan, rig), "plan.gltf");
  EXPECT_EQ(gltf.count("cameras"), 9U);
  ASSERT_EQ(gltf.count("meshes"), 1U);
  const auto& primitive = gltf.element("meshes", 0).at("primitives")[0];
  const auto positions = gltf.numbers(primitive.at("attributes").at("POSITION"), 3);
  ASSERT_EQ(positions.size(), 3 * plan.volumes[0].surface.vertices.size());
  EXPECT_NEAR(positions[0], plan.volumes[0].surface.vertices[0].x(), 1e-6);
}

TEST(CoveragePlan, NamesCannotLookLikeLinesOfAReport) {
  CoverageOptions options;
  options.view_fov_deg = {40};
  options.shares = {1};
  const CoveragePlan plan = plan_coverage("grid\nEvery ray was recorded", grid_rig(3, 3), options);
  EXPECT_THAT(format_coverage_plan(plan),
              HasSubstr("grid\\u000aEvery ray was recorded: 9 cameras\n"));
}

TEST(CoveragePlan, RefusesWhatItCannotCompute) {
  const rig::Rig rig = grid_rig(2, 2);
  const auto refused = [&](const auto& change) {
    CoverageOptions options;
    change(options);
    try {
      plan_coverage("grid", rig, options);
    } catch (const Error& error) {
      return error.exit_code() == ExitCode::kBadInput;
    }
    return false;
  };
  constexpr double kNan = std::numeric_limits<double>::quiet_NaN();
  EXPECT_TRUE(refused([](CoverageOptions& o) { o.view_fov_deg = {0}; }));
  EXPECT_TRUE(refused([](CoverageOptions& o) { o.view_fov_deg = {180}; }));
  EXPECT_TRUE(refused([](CoverageOptions& o) { o.shares = {0}; }));
  EXPECT_TRUE(refused([](CoverageOptions& o) { o.shares = {1.1}; }));
  EXPECT_TRUE(refused([&](CoverageOptions& o) { o.aspect = kNan; }));
  EXPECT_TRUE(refused([&](CoverageOptions& o) { o.interaxial_m = kNan; }));
  EXPECT_TRUE(refused([](CoverageOptions& o) { o.max_yaw_deg = 90; }));
  EXPECT_TRUE(refused([](CoverageOptions& o) { o.tolerance_m = 0; }));
}

// Thesis 5.4: a position counts if every ray from it to the subject passes between the cameras,
// which see its direction. The corners of the subject decide.
TEST(PlanCoverage, OfASubjectEqualsTracingItsCorners) {
  const rig::Rig rig = grid_rig(4, 4);
  CoverageOptions options;
  options.view_fov_deg = {45};
  options.shares = {1};
  options.subject = CoverageSubject{0.1, 0, 2, 0.2};
  const CoveragePlan plan = plan_coverage("rig", rig, options);
  ASSERT_EQ(plan.volumes.size(), 2U);
  const CoverageVolume& volume = plan.volumes.back();
  EXPECT_TRUE(volume.is_of_subject);
  EXPECT_TRUE(volume.is_exact);
  EXPECT_TRUE(is_closed(volume.surface));

  const auto array = rig::find_wall_eyed_array(rig);
  ASSERT_TRUE(array);
  const double half = 0.09;  // of the array
  const auto is_seen_from = [&](const Vector3d& position) {
    for (int corner = 0; corner < 8; ++corner) {
      const Vector3d at(0.1 + ((corner & 1) != 0 ? 0.1 : -0.1), (corner & 2) != 0 ? 0.1 : -0.1,
                        -2 + ((corner & 4) != 0 ? 0.1 : -0.1));
      const Vector3d ray = at - position;
      if (!(ray.z() < 0)) return false;
      const Eigen::Vector2d slope = ray.head<2>() / -ray.z();
      const Eigen::Vector2d crossing = position.head<2>() + position.z() * slope;
      if (crossing.cwiseAbs().maxCoeff() > half || !array->slopes.contains(slope)) return false;
    }
    return true;
  };
  const Vector3d centre(0, 0, 0);
  ASSERT_TRUE(is_seen_from(centre));
  std::mt19937 random(3);
  int inside = 0;
  constexpr int kPoints = 3000;
  for (int i = 0; i < kPoints; ++i) {
    const Vector3d direction = random_direction(random);
    const double distance = std::uniform_real_distribution<>(0, 0.3)(random);
    const auto border = distance_to(volume.surface, centre, direction);
    ASSERT_TRUE(border);
    if (std::abs(distance - *border) < 1e-6) continue;
    const bool is_inside = distance < *border;
    inside += is_inside ? 1 : 0;
    EXPECT_EQ(is_inside, is_seen_from(distance * direction)) << (distance * direction).transpose();
  }
  EXPECT_GT(inside, kPoints / 20);
  // The same, alone and at a place of the world.
  const Vector3d point = plan.array.world_from_camera(Vector3d(0.1, 0, -2));
  const CoveragePlan alone = plan_subject_coverage("rig", rig, point, 0.2);
  ASSERT_EQ(alone.volumes.size(), 1U);
  EXPECT_TRUE(alone.volumes.front().is_of_subject);
  EXPECT_TRUE(alone.array.position.isApprox(plan.array.position));
  EXPECT_NEAR(alone.volumes.front().surface.volume(), volume.surface.volume(),
              1e-9 * volume.surface.volume());
  const Vector3d behind = plan.array.world_from_camera(Vector3d(0, 0, 2));
  EXPECT_THAT(plan_subject_coverage("rig", rig, behind, 0.2).volumes.front().empty_because,
              HasSubstr("not in front"));
  options.subject->depth_m = 0.05;
  EXPECT_THROW(plan_coverage("rig", rig, options), Error);
}

// The views of a subject that is smaller than the array have no end behind it. All of a large one
// is seen from near positions only.
TEST(PlanCoverage, OfASmallSubjectGoesOnBehindTheArray) {
  CoverageOptions options;
  options.view_fov_deg = {45};
  options.shares = {1};
  options.subject = CoverageSubject{0, 0, 2, 0.05};
  const CoveragePlan plan = plan_coverage("rig", grid_rig(4, 4), options);
  const CoverageVolume& volume = plan.volumes.back();
  ASSERT_TRUE(volume.cut_off_m);
  Eigen::AlignedBox3d box;
  for (const Vector3d& vertex : volume.surface.vertices) box.extend(vertex);
  EXPECT_NEAR(box.max().z(), *volume.cut_off_m, 1e-9);
  EXPECT_THAT(format_coverage_plan(plan), HasSubstr("m behind the array, where it goes on, exact"));
  EXPECT_THAT(coverage_plan_as_json(plan), HasSubstr("\"cut_off_m\": 0."));
  options.subject->size_m = 1;
  const CoveragePlan large = plan_coverage("rig", grid_rig(4, 4), options);
  EXPECT_FALSE(large.volumes.back().cut_off_m);
  EXPECT_FALSE(large.volumes.back().surface.vertices.empty());
  EXPECT_THAT(format_coverage_plan(large), Not(HasSubstr("goes on")));
}

TEST(PlanCoverage, OfASubjectIsALowerBoundForRealRigs) {
  schemas::Distortion distortion;
  distortion.k1 = -0.1;
  CoverageOptions options;
  options.view_fov_deg = {30};
  options.shares = {0.9};
  options.tolerance_m = 0.05;
  options.subject = CoverageSubject{0, 0, 2, 0.2};
  const CoveragePlan plan = plan_coverage("rig", grid_rig(4, 4, distortion), options);
  EXPECT_TRUE(plan.volumes.back().is_lower_bound);
  EXPECT_GT(plan.volumes.back().surface.volume(), 0);
  EXPECT_THAT(format_coverage_plan(plan), HasSubstr("at least"));
}

}  // namespace
}  // namespace raystage::planning::coverage_plan_test
