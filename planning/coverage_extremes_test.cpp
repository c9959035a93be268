// SPDX-License-Identifier: Apache-2.0
// What was recorded of views, against textbook intersections in 50 decimal digits: one camera,
// rows, coincident cameras, fields of view of 0.01 to 179 degrees, rotations at the limit, and
// arrays ten thousand kilometres from the origin.
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <boost/multiprecision/cpp_bin_float.hpp>
#include <cmath>
#include <optional>
#include <random>
#include <utility>
#include <vector>

#include "planning/complete_topology.h"
#include "planning/recorded_rays.h"
#include "rig/planning/combined_arrays.h"
#include "rig/planning/effective_resolution.h"
#include "rig/planning/range_of_motion.h"
#include "rig/planning/wall_eyed_array.h"
#include "testing/render/exact_geometry.h"
#include "testing/render/test_poses.h"

namespace raystage::planning::coverage_extremes_test {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;
using testing::kDegree;
using testing::Real;
using Exact2 = std::array<Real, 2>;
using Exact3 = std::array<Real, 3>;

constexpr int kWidth = 640, kHeight = 480;

Real dot(const Exact3& a, const Exact3& b) { return a[0] * b[0] + a[1] * b[1] + a[2] * b[2]; }

/// Returns the rotation^T v.
Exact3 turned_back(const Matrix3d& rotation, const Exact3& v) {
  Exact3 result;
  for (int i = 0; i < 3; ++i) {
    result[i] = rotation(0, i) * v[0] + rotation(1, i) * v[1] + rotation(2, i) * v[2];
  }
  return result;
}

/// A case: an array of equal cameras in a plane, and a view of it.
struct Case {
  int rows = 1, columns = 1;
  double spacing = 0, camera_fov = 0, view_fov = 0;  // radians, horizontal
  rig::Pose pose;                                    // of the array
  Vector3d position = Vector3d::Zero();              // of the view in the array's frame
  Matrix3d array_from_view = Matrix3d::Identity();

  rig::Rig rig() const {
    rig::Rig rig;
    for (int row = 0; row < rows; ++row) {
      for (int column = 0; column < columns; ++column) {
        schemas::CameraGeometry geometry;
        geometry.id = "c" + std::to_string(rig.cameras.size());
        geometry.width = kWidth;
        geometry.height = kHeight;
        geometry.intrinsics.fx = geometry.intrinsics.fy = kWidth / 2.0 / std::tan(camera_fov / 2);
        geometry.intrinsics.cx = kWidth / 2.0;
        geometry.intrinsics.cy = kHeight / 2.0;
        rig::Pose of_camera = pose;
        of_camera.position = pose.world_from_camera(
            {spacing * (column - (columns - 1) / 2.0), spacing * (row - (rows - 1) / 2.0), 0});
        rig.cameras.push_back(
            {geometry.id, rig::CameraModel(geometry), of_camera, {}, row, column});
      }
    }
    return rig;
  }
  render::VirtualCamera view() const {
    render::VirtualCamera view = render::virtual_camera_with_fov(kWidth, kHeight, view_fov, {});
    view.pose.position = pose.world_from_camera(position);
    view.pose.world_from_camera_rotation = pose.world_from_camera_rotation * array_from_view;
    return view;
  }
  Vector2d half_size() const { return {spacing * (columns - 1) / 2, spacing * (rows - 1) / 2}; }
};

/// Returns the position of the view in the array's frame, of the rounded one in the world.
Exact3 exact_position(const Case& given) {
  const Vector3d world = given.view().pose.position;
  Exact3 from_array;
  for (int i = 0; i < 3; ++i) from_array[i] = Real(world[i]) - Real(given.pose.position[i]);
  return turned_back(given.pose.world_from_camera_rotation, from_array);
}

/// Returns a ray of the view in the array's frame.
Exact3 exact_ray(const Case& given, const Exact2& pixel) {
  const render::VirtualCamera view = given.view();
  const schemas::Intrinsics& k = view.intrinsics;
  const Exact3 in_view{(pixel[0] - k.cx) / k.fx, -(pixel[1] - k.cy) / k.fy, -1};
  Exact3 world;
  for (int i = 0; i < 3; ++i) {
    const auto row = view.pose.world_from_camera_rotation.row(i);
    world[i] = row[0] * in_view[0] + row[1] * in_view[1] + row[2] * in_view[2];
  }
  return turned_back(given.pose.world_from_camera_rotation, world);
}

/// Returns normals n of the recorded rays d in the array's frame: n.d >= 0.
std::vector<Exact3> exact_borders(const Case& given) {
  const rig::Rig rig = given.rig();
  const rig::SlopeRange slopes =
      rig::camera_slopes(rig.cameras[0].model.intrinsics(), kWidth, kHeight);
  std::vector<Exact3> normals{{0, 0, -1}};
  for (int axis = 0; axis < 2; ++axis) {
    Exact3 least{0, 0, Real(slopes.least[axis])}, largest{0, 0, -Real(slopes.largest[axis])};
    least[axis] = 1;
    largest[axis] = -1;
    normals.push_back(least);
    normals.push_back(largest);
  }
  // The crossing P_xy + P_z m is within the array, along each axis along which there is one.
  const Exact3 p = exact_position(given);
  const Vector2d half = given.half_size();
  for (int axis = 0; axis < 2; ++axis) {
    if (half[axis] == 0) continue;
    for (const int sign : {-1, 1}) {
      Exact3 normal{0, 0, -(half[axis] - sign * p[axis])};
      normal[axis] = -sign * p[2];
      normals.push_back(normal);
    }
  }
  return normals;
}

/// Returns the recorded share of the picture, by clipping it.
double exact_share(const Case& given) {
  std::vector<Exact2> picture{{0, 0}, {kWidth, 0}, {kWidth, kHeight}, {0, kHeight}};
  for (const Exact3& normal : exact_borders(given)) {
    std::vector<Exact2> kept;
    for (std::size_t i = 0; i < picture.size(); ++i) {
      const Exact2 &from = picture[i], &to = picture[(i + 1) % picture.size()];
      const Real at_from = dot(normal, exact_ray(given, from)),
                 at_to = dot(normal, exact_ray(given, to));
      if (at_from >= 0) kept.push_back(from);
      if ((at_from >= 0) != (at_to >= 0)) {
        const Real share = at_from / (at_from - at_to);
        kept.push_back({from[0] + share * (to[0] - from[0]), from[1] + share * (to[1] - from[1])});
      }
    }
    picture = std::move(kept);
  }
  Real twice = 0;
  for (std::size_t i = 0; i < picture.size(); ++i) {
    const Exact2 &a = picture[i], &b = picture[(i + 1) % picture.size()];
    twice += a[0] * b[1] - a[1] * b[0];
  }
  return static_cast<double>(abs(twice) / 2 / (Real(kWidth) * kHeight));
}

class Cases {
 public:
  Case next() {
    const auto any_of = [&](std::initializer_list<double> values) {
      return values.begin()[random_() % values.size()];
    };
    Case made;
    made.rows = static_cast<int>(any_of({1, 2, 5}));
    made.columns = static_cast<int>(any_of({1, 2, 4}));
    made.spacing = any_of({0, 1e-6, 0.06, 0.06, 100});
    made.camera_fov = any_of({0.01, 1, 62, 120, 179}) * kDegree;
    const double largest = made.camera_fov * (1 - 1e-6);
    made.view_fov = std::min(any_of({0.01, 1, 40, 90, 179}) * kDegree,
                             random_() % 2 == 0 ? largest : 179 * kDegree);
    const double offset = any_of({0, 0, 1e3, 1e7});
    made.pose = {testing::make_pose(Vector3d::Zero(), 90 * unit_(random_), 40 * unit_(random_))
                     .world_from_camera_rotation,
                 {offset, -offset, 0.3 * offset}};
    // Turned by up to where the view leaves the cameras' frusta, and exactly to there.
    const double limit = std::abs(made.camera_fov - made.view_fov) / 2;
    const double yaw = any_of({0, 0.5, -0.5, 1, -1, unit_(random_)}) * limit;
    made.array_from_view =
        Eigen::AngleAxisd(std::clamp(yaw, -1.5, 1.5), Vector3d::UnitY()).toRotationMatrix();
    const double extent = std::max(1e-3, made.half_size().maxCoeff());
    made.position = {extent * unit_(random_) * (made.columns > 1 ? 1 : 0),
                     extent * unit_(random_) * (made.rows > 1 ? 1 : 0),
                     extent * unit_(random_) * any_of({1e-3, 1, 1, 10})};
    // Of rows, rays in their plane are decided by rounding: the view is on it in rows only.
    return made;
  }
  /// Returns how far shares may differ: rounded positions move the array's border in the picture.
  static double tolerance(const Case& given) {
    const double rounding =
        1e-15 * (given.pose.position.norm() + given.position.norm() + given.half_size().norm());
    const double footprint = std::abs(given.position.z()) * std::tan(given.view_fov / 2);
    // Nearly at the limit, rotations that are rounded move the border of the frusta, too.
    return 2e-9 + 8 * rounding / std::max(1e-300, footprint) + 1e-13 / std::tan(given.view_fov / 2);
  }

 private:
  std::mt19937 random_{20051};
  std::uniform_real_distribution<double> unit_{-1, 1};
};

TEST(CoverageExtremes, UnrecordedSharesAreExact) {
  Cases cases;
  int partial = 0, tight = 0;
  for (int i = 0; i < 7000; ++i) {
    const Case given = cases.next();
    const rig::Rig rig = given.rig();
    const double share = unrecorded_share(given.view(), rig, complete_topology(rig), {0, 0, 0, 1});
    const double expected = 1 - exact_share(given);
    EXPECT_NEAR(share, expected, Cases::tolerance(given))
        << i << ": " << given.rows << " x " << given.columns << ", " << given.spacing
        << " m, cameras " << given.camera_fov / kDegree << ", view " << given.view_fov / kDegree
        << " deg, offset " << given.pose.position.x() << ", at " << given.position.transpose();
    partial += expected > 1e-3 && expected < 1 - 1e-3 ? 1 : 0;
    tight += Cases::tolerance(given) < 1e-8 ? 1 : 0;
  }
  EXPECT_GT(partial, 500);
  EXPECT_GT(tight, 3000);
}

TEST(CoverageExtremes, SharesOfCombinedArraysAreExact) {
  Cases cases;
  int partial = 0;
  for (int i = 0; i < 7000; ++i) {
    const Case given = cases.next();
    const Vector2d half = given.half_size();
    if (half.minCoeff() == 0) continue;
    rig::MemberArray array;
    array.rays.pose = given.pose;
    array.rays.hull = {{-half.x(), -half.y()}, {half.x(), -half.y()}, half, {-half.x(), half.y()}};
    array.rays.slopes =
        rig::camera_slopes(given.rig().cameras[0].model.intrinsics(), kWidth, kHeight);
    array.outline = array.rays.hull;
    const render::VirtualCamera view = given.view();
    const double share = rig::CombinedArrays({array}, true)
                             .recorded_share(view.pose.position,
                                             {rig::camera_slopes(view.intrinsics, kWidth, kHeight),
                                              view.pose.world_from_camera_rotation});
    const double expected = exact_share(given);
    EXPECT_NEAR(share, expected, Cases::tolerance(given)) << i;
    partial += expected > 1e-3 && expected < 1 - 1e-3 ? 1 : 0;
  }
  EXPECT_GT(partial, 200);
}

TEST(CoverageExtremes, RangesOfMotionAreExact) {
  Cases cases;
  int inside = 0;
  for (int i = 0; i < 7000; ++i) {
    const Case given = cases.next();
    const Vector2d half = given.half_size();
    if (half.minCoeff() == 0) continue;
    rig::WallEyedArray array;
    array.pose = given.pose;
    array.hull = {{-half.x(), -half.y()}, {half.x(), -half.y()}, half, {-half.x(), half.y()}};
    array.slopes = rig::camera_slopes(given.rig().cameras[0].model.intrinsics(), kWidth, kHeight);
    const render::VirtualCamera view = given.view();
    const rig::RangeOfMotion range =
        rig::range_of_motion(array, {rig::camera_slopes(view.intrinsics, kWidth, kHeight),
                                     view.pose.world_from_camera_rotation});
    if (range.positions.is_empty()) continue;
    // The distance of the least of the planes n.P + (n.m) P_z = c.
    const Exact3 p = exact_position(given);
    Real least = 1e300;
    for (const Exact2& corner : {Exact2{0, 0}, {kWidth, 0}, {kWidth, kHeight}, {0, kHeight}}) {
      const Exact3 ray = exact_ray(given, corner);
      for (int axis = 0; axis < 2; ++axis) {
        for (const int sign : {-1, 1}) {
          const Real slope = sign * ray[axis] / -ray[2];
          least = std::min<Real>(
              least, (half[axis] - sign * p[axis] - slope * p[2]) / sqrt(1 + slope * slope));
        }
      }
    }
    const double expected = static_cast<double>(least);
    const double rounding = 1e-15 * given.pose.position.norm();
    const double found =
        range.positions.signed_distance(given.pose.camera_from_world(view.pose.position));
    const double scale = half.norm() + given.position.norm();
    if (expected > 0) {
      EXPECT_NEAR(found, expected, 1e-12 * scale + 4 * rounding) << i;
      ++inside;
    } else {
      // Beyond an edge or a vertex it is farther than from each plane.
      EXPECT_LE(found, expected + 1e-12 * scale + 4 * rounding) << i;
    }
  }
  EXPECT_GT(inside, 100);
}

// Thesis eq. 5.15 to 5.17: with the pitch, the first two pixels' rays are one pixel of the cameras
// apart, by the definition of a ray's slope.
TEST(CoverageExtremes, SamplingPitchesAreExact) {
  std::mt19937 random(20051);
  std::uniform_real_distribution<double> unit(-1, 1);
  const double degrees[] = {0.01, 1, 45, 120, 179};
  int finite = 0;
  for (int i = 0; i < 5000; ++i) {
    rig::CameraRow row;
    row.focal_length = std::exp(5 * unit(random));
    row.pixel_pitch = row.focal_length * std::exp(-5 + 4 * unit(random));
    row.fov = 179 * kDegree;
    rig::RowView view;
    view.focal_length = std::exp(5 * unit(random));
    view.fov = degrees[random() % 5] * kDegree;
    view.rotation = unit(random) * (i % 3 == 0 ? 1.0 : i % 3 == 1 ? 1e-9 : 89.9 * kDegree);
    const double pitch = rig::exact_sampling_pitch(row, view);
    if (pitch == 0 || !std::isfinite(pitch)) continue;
    ++finite;
    const Real s = sin(Real(view.rotation)), c = cos(Real(view.rotation));
    const auto slope_of = [&](const Real& u) { return Real((u * c - s) / (u * s + c)); };
    const Real first = -tan(Real(view.fov) / 2);
    const Real second = first + Real(pitch) / view.focal_length;
    const Real step = row.focal_length * (slope_of(second) - slope_of(first));
    // The first ray may be nearly parallel to the row, where its angle's rounding counts.
    const double grazing = static_cast<double>(1 / abs(first * s + c));
    EXPECT_NEAR(static_cast<double>(step / row.pixel_pitch), 1,
                1e-12 * (1 + grazing) * (1 + grazing))
        << i;
  }
  EXPECT_GT(finite, 2000);
}

}  // namespace
}  // namespace raystage::planning::coverage_extremes_test
