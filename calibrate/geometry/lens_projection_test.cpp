// SPDX-License-Identifier: Apache-2.0
// The solvers' projection against rig::CameraModel and numeric differences.
#include "calibrate/geometry/lens_projection.h"

#include <gtest/gtest.h>

#include <numbers>
#include <random>

#include "calibrate/geometry/array_model.h"
#include "calibrate/geometry/observation_jacobian.h"

namespace raystage::calibrate {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using schemas::Projection;

constexpr double kDegree = std::numbers::pi / 180;

struct ProjectionCase {
  schemas::Intrinsics lens;
  double largest_deg;  // of the tested rays
};

ProjectionCase projection_case(Projection projection, double largest_deg) {
  ProjectionCase result{{210, 207, 322, 236, {}}, largest_deg};
  result.lens.projection = projection;
  if (projection == Projection::kPinhole) {
    result.lens.distortion = {-0.05, 0.01, 0.001, -0.002, -0.001};
  } else {
    result.lens.radial_distortion = {-0.02, 0.003, -0.0004, 0.00002};
  }
  return result;
}

class SolverProjections : public ::testing::TestWithParam<ProjectionCase> {};

/// Returns a point in the camera at an angle to the axis.
Vector3d point_at(double angle, double around, double distance) {
  return distance * Vector3d(std::sin(angle) * std::cos(around), std::sin(angle) * std::sin(around),
                             -std::cos(angle));
}

TEST_P(SolverProjections, EqualThoseOfTheCameraModel) {
  const ProjectionCase& test = GetParam();
  const rig::CameraModel model({"c", 640, 480, test.lens, {}, {}, {}});
  const LensParameters values = lens_parameters(test.lens);
  const rig::RadialProjection* fisheye = fisheye_projection(test.lens);
  for (int i = 0; i <= 400; ++i) {
    // From far below the nearness to the axis that needs care to the largest angle.
    const double share = i < 100 ? std::pow(10.0, -0.15 * i) : i / 400.0;
    const Vector3d point = point_at(test.largest_deg * kDegree * share, 0.1 + i, 0.3 + 0.01 * i);
    const auto expected = model.project(point);
    ASSERT_TRUE(expected) << i;
    ASSERT_TRUE(has_projection<double>(point, fisheye));
    const Vector2d found = project_to_pixel<double>(point, values.data(), fisheye, false);
    EXPECT_LE((found - *expected).norm(), 1e-11 * 640) << i;
  }
}

/// Derivatives by central differences of the camera model, whose formulas are others.
TEST_P(SolverProjections, HaveTheDerivativesOfTheCameraModel) {
  const ProjectionCase& test = GetParam();
  ArrayModel model;
  model.cameras.push_back({"c", 640, 480, test.lens, rig::Pose{}});
  model.cameras.front().pose->position = {0.1, -0.2, 0.3};
  model.cameras.front().pose->world_from_camera_rotation =
      Eigen::AngleAxisd(0.7, Vector3d(1, 2, -1).normalized()).toRotationMatrix();
  BundleAdjustmentOptions free;
  free.lens = LensRefinement::kFullModel;
  std::mt19937 random(4);
  std::uniform_real_distribution<double> share(0, 1);
  for (int i = 0; i < 200; ++i) {
    // Every tenth point is as near to the axis as numeric differences allow.
    const double angle = (i % 10 == 0 ? 1e-3 : 1.0) * test.largest_deg * kDegree * share(random);
    const Vector3d in_camera = point_at(angle, 7 * share(random), 0.5 + share(random));
    const rig::Pose pose = *model.cameras.front().pose;
    model.points = {pose.world_from_camera(in_camera)};
    model.point_ids = {0};
    model.observations = {{0, 0, {0, 0}}};
    const ParameterLayout layout = make_parameter_layout(model, free);
    const ObservationRows rows = observation_rows(model, model.observations.front(), layout);
    const auto seen = [&](const schemas::Intrinsics& lens, const rig::Pose& at, const Vector3d& x) {
      return *rig::CameraModel({"c", 640, 480, lens, {}, {}, {}}).project(at.camera_from_world(x));
    };
    const auto expect_column = [&](const Vector2d& found, const Vector2d& ahead,
                                   const Vector2d& behind, double step, const char* what) {
      const Vector2d expected = (ahead - behind) / (2 * step);
      EXPECT_LE((found - expected).norm(), 2e-5 * (1 + expected.norm())) << what << ", point " << i;
    };
    const Vector3d x = *model.points.front();
    constexpr double kStep = 1e-6;
    for (int k = 0; k < 3; ++k) {
      const Vector3d step = kStep * Vector3d::Unit(k);
      expect_column(rows.by_point.col(k), seen(test.lens, pose, x + step),
                    seen(test.lens, pose, x - step), kStep, "point");
      rig::Pose ahead = pose, behind = pose;
      ahead.position += step;
      behind.position -= step;
      expect_column(rows.by_unknowns.col(3 + k), seen(test.lens, ahead, x),
                    seen(test.lens, behind, x), kStep, "position");
    }
    const LensParameters values = lens_parameters(test.lens);
    const std::vector<int>& refined = layout.free_lens_parameters.front();
    EXPECT_EQ(refined.size(), test.lens.projection == Projection::kPinhole ? 9U : 8U);
    for (std::size_t k = 0; k < refined.size(); ++k) {
      const double step = refined[k] < 4 ? 1e-4 : 1e-7;
      LensParameters ahead = values, behind = values;
      ahead[refined[k]] += step;
      behind[refined[k]] -= step;
      expect_column(rows.by_unknowns.col(6 + static_cast<Eigen::Index>(k)),
                    seen(lens_with_parameters(ahead, test.lens), pose, x),
                    seen(lens_with_parameters(behind, test.lens), pose, x), step, "lens");
    }
  }
}

INSTANTIATE_TEST_SUITE_P(All, SolverProjections,
                         ::testing::Values(projection_case(Projection::kPinhole, 50),
                                           projection_case(Projection::kFisheye, 110),
                                           projection_case(Projection::kFtheta, 110),
                                           projection_case(Projection::kEquisolid, 120),
                                           projection_case(Projection::kOrthographic, 88)));

TEST(SolverProjection, ContinuesBeyondTheEndOfTheProjection) {
  const rig::RadialProjection& projection = rig::orthographic_projection();
  using Jet = ceres::Jet<double, 1>;
  for (const double angle : {0.3, 1.5, std::numbers::pi / 2, 1.6, 2.5}) {
    const Jet found = continued_distance(projection, Jet(angle, 0));
    EXPECT_DOUBLE_EQ(found.a, angle < 1.58 ? std::sin(angle) : 1);
    EXPECT_NEAR(found.v[0], angle < 1.58 ? std::cos(angle) : 0, 1e-15);
  }
}

TEST(SolverProjection, ExcludesPointsThatNoLensSees) {
  const rig::RadialProjection* fisheye = &rig::equidistant_projection();
  EXPECT_FALSE(has_projection<double>({0, 0, 0}, fisheye));
  EXPECT_FALSE(has_projection<double>({0, 0, 1}, fisheye));
  EXPECT_TRUE(has_projection<double>({0.1, 0, 1}, fisheye));
  EXPECT_TRUE(has_projection<double>({0, 0, -1}, fisheye));
  EXPECT_FALSE(has_projection<double>({0.1, 0, 1}, nullptr));
  EXPECT_TRUE(has_projection<double>({0.1, 0, -1}, nullptr));
}

}  // namespace
}  // namespace raystage::calibrate
