// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "base/error.h"
#include "render/common/plane_projection.h"
#include "render/common/ray_cells.h"
#include "testing/render/exact_geometry.h"
#include "testing/render/geometry_generators.h"

namespace raystage::render {
namespace {

using testing::between;
using testing::direction;
using testing::exact_depth;
using testing::exact_pixel;
using testing::exact_plane_distance;
using testing::exact_ray;
using testing::random_origin;
using testing::random_plane;
using testing::random_pose;
using testing::Real;

TEST(PlaneProjectionExtremes, HeightIsThatOf50Digits) {
  EXPECT_TRUE(rc::check("any plane and point", [] {
    const Eigen::Vector3d point = random_origin() + 3 * direction();
    const double distance = *rc::gen::element(0.0, 1e-12, 1e-6, 1e-3, 1.0, -1.0, 1e9);
    const Eigen::Vector4d plane = random_plane(point, distance);
    const Real truth = exact_plane_distance(plane, point);
    const double magnitude =
        (plane.head<3>().cwiseProduct(point).cwiseAbs().sum() + std::abs(plane.w())) /
        plane.head<3>().norm();
    const double height = signed_plane_distance(plane, point);
    if (height == 0) {  // the true distance is within rounding
      RC_ASSERT(static_cast<double>(abs(truth)) <= 1e-15 * magnitude);
    } else {
      RC_ASSERT(std::abs(static_cast<double>((height - truth) / truth)) < 4e-15);
    }
  }));
}

TEST(PlaneProjectionExtremes, APlaneThroughTheEyeIsFoundToBe) {
  EXPECT_TRUE(rc::check("any plane laid through any point", [] {
    const Eigen::Vector3d point = random_origin() + 3 * direction();
    RC_ASSERT(signed_plane_distance(random_plane(point, 0), point) == 0);
  }));
  EXPECT_EQ(signed_plane_distance({0, 0, 1, -1e-12}, Eigen::Vector3d::Zero()), -1e-12);
}

TEST(PlaneProjectionExtremes, PositionsAndDepthsAreThoseOf50Digits) {
  int met = 0;
  EXPECT_TRUE(rc::check("any view, camera and plane", [&] {
    const Eigen::Vector3d around = random_origin();
    const double behind = *rc::gen::element(0.0, 1.0, 1e6);
    const double fov = *rc::gen::element(0.01, 1.0, 50.0, 120.0, 179.0) * std::numbers::pi / 180;
    const int width = *rc::gen::element(1, 640, 16384);
    const VirtualCamera view = virtual_camera_with_fov(width, 10, fov, random_pose(around, behind));
    const rig::Pose camera = random_pose(around, *rc::gen::element(0.0, 1e-3, 0.2));
    const schemas::Intrinsics k{600, 600, 320, 240, {}};
    const double distance = *rc::gen::element(1e-3, 0.1, 4.0, 1e6, 1e9);
    const bool infinite = *rc::gen::inRange(0, 8) == 0;
    const Eigen::Vector4d plane =
        infinite ? Eigen::Vector4d(0, 0, 0, 1) : random_plane(view.pose.position, distance);
    const PlaneProjection projection(view, plane);
    const double x = between(0, width), y = between(0, 10);
    const auto ray = exact_ray(view, x, y);
    // The rounding of the ray in double: far from the view's axis its terms are larger than itself.
    const Eigen::Vector3d rounded = world_ray_from_pixel(view) * Eigen::Vector3d(x, y, 1);
    const double reach = (rounded.norm() + 2 * view.intrinsics.cx / view.intrinsics.fx);
    const double epsilon = 32 * std::numeric_limits<double>::epsilon();

    if (!infinite) {
      const double slope = std::abs(plane.head<3>().normalized().dot(rounded));
      const auto truth = exact_depth(plane, view.pose.position, ray);
      const double depth = projection.depth(x, y);
      RC_ASSERT(std::isfinite(depth) && depth >= 0);
      if (slope < 1e-6 * reach) return;  // nearly parallel to the plane: any depth is correct
      RC_ASSERT(truth.has_value());
      RC_ASSERT((depth > 0) == (*truth > 0));
      if (depth > 0) {
        RC_ASSERT(std::abs(static_cast<double>(depth / *truth - 1)) < epsilon * reach / slope);
      }
    }
    if (projection.depth(x, y) == 0) return;
    const Eigen::Vector3d ideal = projection.ideal_from_pixel(camera) * Eigen::Vector3d(x, y, 1);
    RC_ASSERT(ideal.allFinite());
    const auto truth = exact_pixel(k, camera, plane, view.pose.position, ray);
    if (!truth || abs((*truth)[0]) > 1000 || abs((*truth)[1]) > 1000) return;  // not in its image
    ++met;
    RC_ASSERT(ideal.z() > 0);
    // (X, Y, W) is a sum of two vectors. Where they nearly cancel, the camera is on the plane, next
    // to the point.
    const double parts = projection.distance() * reach +
                         (view.pose.position - camera.position).norm() *
                             (projection.slope().cwiseAbs().dot(Eigen::Vector3d(width, 10, 1)));
    const double bound = epsilon * 600 * 3 * parts / ideal.z();
    const double error_x =
        static_cast<double>(abs(k.fx * ideal.x() / ideal.z() + k.cx - (*truth)[0]));
    const double error_y =
        static_cast<double>(abs(k.fy * ideal.y() / ideal.z() + k.cy - (*truth)[1]));
    RC_LOG() << "errors " << error_x << ", " << error_y << " px, bound " << bound << '\n';
    RC_ASSERT(std::max(error_x, error_y) <= bound);
  }));
  EXPECT_GT(met, 0);  // else nothing was tested
}

TEST(PlaneProjectionExtremes, RefusesAPlaneOutOfAllRange) {
  const VirtualCamera view = virtual_camera_with_fov(10, 10, 1, {});
  EXPECT_THROW(PlaneProjection(view, {0, 0, 1, 1e31}), Error);
  EXPECT_THROW(PlaneProjection(view, {0, 0, 5e-324, 1}), Error);
  EXPECT_NO_THROW(PlaneProjection(view, {0, 0, 1e300, 4e300}));
  EXPECT_NEAR(PlaneProjection(view, {0, 0, 1e300, 4e300}).depth(5, 5), 4, 1e-12);
}

}  // namespace
}  // namespace raystage::render
