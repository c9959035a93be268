// SPDX-License-Identifier: Apache-2.0
#include "rig/planning/combined_arrays.h"

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <cmath>
#include <numbers>
#include <optional>
#include <random>

namespace raystage::rig {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr double kPi = std::numbers::pi;

/// A square array that looks outwards along `direction`, `distance` from the world's origin.
MemberArray side_of_box(const Vector3d& direction, double distance, double half_size,
                        double half_fov, const Vector3d& origin = Vector3d::Zero()) {
  MemberArray array;
  const Vector3d up = std::abs(direction.y()) > 0.9 ? Vector3d::UnitZ() : Vector3d::UnitY();
  Matrix3d& rotation = array.rays.pose.world_from_camera_rotation;
  rotation.col(2) = -direction;
  rotation.col(0) = up.cross(-direction).normalized();
  rotation.col(1) = rotation.col(2).cross(rotation.col(0));
  array.rays.pose.position = origin + distance * direction;
  array.rays.hull = {{-half_size, -half_size},
                     {half_size, -half_size},
                     {half_size, half_size},
                     {-half_size, half_size}};
  array.rays.slopes = symmetric_slopes(2 * half_fov, 2 * half_fov);
  array.outline = array.rays.hull;
  return array;
}

std::vector<MemberArray> box(double edge, double half_size, double half_fov,
                             const Vector3d& origin = Vector3d::Zero()) {
  std::vector<MemberArray> sides;
  for (int axis = 0; axis < 3; ++axis) {
    for (const double sign : {1.0, -1.0}) {
      sides.push_back(
          side_of_box(sign * Vector3d::Unit(axis), edge / 2, half_size, half_fov, origin));
    }
  }
  return sides;
}

/// Returns where the line through a position crosses an array's outline, as a multiple of the
/// direction; nullopt outside.
std::optional<double> crossing(const MemberArray& array, const std::vector<Vector2d>& outline,
                               const Vector3d& position, const Vector3d& direction) {
  const Vector3d from = array.rays.pose.camera_from_world(position);
  const Vector3d along = array.rays.pose.world_from_camera_rotation.transpose() * direction;
  const double t = -from.z() / along.z();
  const Vector2d at = from.head<2>() + t * along.head<2>();
  for (std::size_t i = 0; i < outline.size(); ++i) {
    const Vector2d side = outline[(i + 1) % outline.size()] - outline[i];
    const Vector2d to = at - outline[i];
    if (side.x() * to.y() - side.y() * to.x() < 0) return std::nullopt;
  }
  return t;
}

bool sees_slope(const MemberArray& array, const Vector3d& direction) {
  const Vector3d along = array.rays.pose.world_from_camera_rotation.transpose() * direction;
  return along.z() < 0 && array.rays.slopes.contains(along.head<2>() / -along.z());
}

/// The obvious way: follows one ray. It counts if an array's plane is crossed in its hull with a
/// slope that the cameras see, and no other outline is crossed later.
bool is_ray_recorded(const std::vector<MemberArray>& arrays, bool hide, const Vector3d& position,
                     const Vector3d& direction) {
  for (std::size_t i = 0; i < arrays.size(); ++i) {
    const auto t = crossing(arrays[i], arrays[i].rays.hull, position, direction);
    if (!t || !sees_slope(arrays[i], direction)) continue;
    bool is_hidden = false;
    for (std::size_t j = 0; j < arrays.size() && hide; ++j) {
      const auto other = crossing(arrays[j], arrays[j].outline, position, direction);
      is_hidden = is_hidden || (j != i && other && *other > *t);
    }
    if (!is_hidden) return true;
  }
  return false;
}

TEST(DirectionPolygon, SolidAngles) {
  double sum = 0;
  for (const DirectionPolygon& side : all_directions()) sum += side.solid_angle();
  EXPECT_NEAR(sum, 4 * kPi, 1e-12);
  const std::vector<Vector3d> octant{Vector3d::UnitX(), Vector3d::UnitY(), Vector3d::UnitZ()};
  EXPECT_NEAR(DirectionPolygon(octant).solid_angle(), kPi / 2, 1e-14);
  // A cap of four planes is taken away from the sphere: what is left does not overlap.
  const std::vector<Vector3d> pyramid{{1, 0, -1}, {-1, 0, -1}, {0, 1, -1}, {0, -1, -1}};
  double left = 0;
  for (const DirectionPolygon& part : without(all_directions(), pyramid)) {
    left += part.solid_angle();
  }
  EXPECT_NEAR(left, 4 * kPi * 5 / 6, 1e-12);
}

// Every share against following a million rays, for arrays in random poses that hide each other.
TEST(CombinedArrays, SharesAreThoseOfRandomRays) {
  std::mt19937 random(20051);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::normal_distribution<double> any;
  const auto direction = [&] {
    return Vector3d(any(random), any(random), any(random)).normalized();
  };
  for (int trial = 0; trial < 10; ++trial) {
    std::vector<MemberArray> arrays;
    for (int i = 0; i < 3 + trial % 3; ++i) {
      arrays.push_back(side_of_box(direction(), 0.3 + unit(random) * 0.6, 0.8 + 0.5 * unit(random),
                                   0.7 + 0.3 * unit(random)));
    }
    const Vector3d position = 0.3 * Vector3d(unit(random), unit(random), unit(random));
    for (const bool hide : {false, true}) {
      const CombinedArrays combined(arrays, hide);
      constexpr int kRays = 50'000;
      int recorded = 0;
      for (int ray = 0; ray < kRays; ++ray) {
        recorded += is_ray_recorded(arrays, hide, position, direction()) ? 1 : 0;
      }
      const double share = static_cast<double>(recorded) / kRays;
      const double error = std::sqrt(std::max(1e-4, share * (1 - share)) / kRays);
      EXPECT_NEAR(combined.recorded_share_of_all(position), share, 5 * error) << trial << hide;

      ViewFrustum view;
      view.slopes = symmetric_slopes(1.2, 0.9);
      view.world_from_camera_rotation =
          Eigen::Quaterniond::FromTwoVectors(-Vector3d::UnitZ(), direction()).toRotationMatrix();
      recorded = 0;
      for (int ray = 0; ray < kRays; ++ray) {
        const Vector3d in_view(view.slopes.largest.x() * unit(random),
                               view.slopes.largest.y() * unit(random), -1);
        recorded +=
            is_ray_recorded(arrays, hide, position, view.world_from_camera_rotation * in_view) ? 1
                                                                                               : 0;
      }
      EXPECT_NEAR(combined.recorded_share(position, view), static_cast<double>(recorded) / kRays,
                  5 * std::sqrt(0.25 / kRays));
    }
  }
}

// Thesis 6.2, figures 6-7 and 6-8: sides of 3 l with 90 degrees record all rays where
// |x| + |y|, |y| + |z| and |z| + |x| are at most l. That contains the cube of l.
TEST(CombinedArrays, ExtendedBoxOfTheThesis) {
  const double l = 0.4;
  const CombinedArrays combined(box(l, 1.5 * l, kPi / 4), false);
  std::mt19937 random(20051);
  std::uniform_real_distribution<double> place(-1.2 * l, 1.2 * l);
  int inside = 0;
  for (int i = 0; i < 2000; ++i) {
    const Vector3d p(place(random), place(random), place(random));
    const Vector3d a = p.cwiseAbs();
    const double sum = std::max({a.x() + a.y(), a.y() + a.z(), a.z() + a.x()});
    if (std::abs(sum - l) < 1e-6 * l) continue;
    inside += sum < l ? 1 : 0;
    EXPECT_EQ(combined.recorded_share_of_all(p) > 1 - 1e-12, sum < l) << p.transpose();
  }
  EXPECT_GT(inside, 100);
  // Where the sides are real, they hide rays of each other. In the middle a ray with the slopes u
  // and v is recorded if it passes the ends of the neighbouring sides: up to 1/3.
  const CombinedArrays real(box(l, 1.5 * l, kPi / 4), true);
  const double third = 1.0 / 3;
  const double share =
      6 * 4 * std::atan(third * third / std::sqrt(1 + 2 * third * third)) / (4 * kPi);
  EXPECT_NEAR(real.recorded_share_of_all(Vector3d::Zero()), share, 1e-12);
  EXPECT_LT(share, 0.2);
}

// Thesis 6.2: a simple cube with 90 degrees records all rays in its exact centre only.
TEST(CombinedArrays, SimpleCubeShowsAllInItsCentreOnly) {
  for (const bool hide : {false, true}) {
    const CombinedArrays combined(box(0.4, 0.2, kPi / 4), hide);
    EXPECT_NEAR(combined.recorded_share_of_all(Vector3d::Zero()), 1, 1e-12);
    for (const double away : {1e-4, 1e-3, 1e-2}) {
      const double missing = 1 - combined.recorded_share_of_all({away, 0, 0});
      EXPECT_GT(missing, 0.1 * away / 0.4);
    }
  }
  // With a larger field of view T = tan of its half: T |x| + |y| <= (T - 1) l / 2, for all axes.
  const double l = 0.4, slope = std::tan(0.9);
  const CombinedArrays wide(box(l, l / 2, 0.9), true);
  std::mt19937 random(20051);
  std::uniform_real_distribution<double> place(-0.1, 0.1);
  for (int i = 0; i < 2000; ++i) {
    const Vector3d p(place(random), place(random), place(random));
    Vector3d a = p.cwiseAbs();
    std::ranges::sort(a, std::greater<>());
    const double sum = slope * a[0] + a[1];
    if (std::abs(sum - (slope - 1) * l / 2) < 1e-9) continue;
    EXPECT_EQ(wide.recorded_share_of_all(p) > 1 - 1e-12, sum < (slope - 1) * l / 2);
  }
}

// Figure 6-9: an object outside of the box, in front of two of its extended sides, is seen by these
// two: in the plane of the cross-section from half of all directions.
TEST(CombinedArrays, ObjectOutsideIsSeenByTwoSides) {
  const double l = 0.4;
  const std::vector<MemberArray> sides = box(l, 1.5 * l, kPi / 4);
  const Vector3d object(0.75 * l, 0.75 * l, 0);
  const CombinedArrays combined(sides, false);
  const CombinedArrays::SeenPoint seen = combined.seen_point(object);
  EXPECT_EQ(seen.arrays, 2);
  EXPECT_NEAR(seen.share, 2.0 / 6, 1e-12);
  std::vector<MemberArray> facing;
  for (const MemberArray& side : sides) {
    if (side.rays.pose.camera_from_world(object).z() < 0) facing.push_back(side);
  }
  int recorded = 0;
  constexpr int kDirections = 3600;
  for (int i = 0; i < kDirections; ++i) {
    const double angle = 2 * kPi * (i + 0.5) / kDirections;
    recorded +=
        is_ray_recorded(facing, false, object, {std::cos(angle), std::sin(angle), 0}) ? 1 : 0;
  }
  EXPECT_EQ(recorded, kDirections / 2);
  // Inside the box nothing is in front of a side.
  EXPECT_EQ(combined.seen_point({0.1 * l, 0, 0}).arrays, 0);
}

// Figure 6-10: eight sides instead of four. Off their middle, rays near the edges of the sides are
// more inclined than the cameras see.
TEST(CombinedArrays, RotatedSidesLackRaysAwayFromTheirMiddle) {
  const double distance = 0.5, half = distance * std::tan(kPi / 8);
  std::vector<MemberArray> sides;
  for (int i = 0; i < 8; ++i) {
    const double angle = i * kPi / 4;
    sides.push_back(side_of_box({std::cos(angle), 0, std::sin(angle)}, distance, half, kPi / 4));
  }
  const CombinedArrays combined(sides, true);
  const auto missing = [&](const Vector3d& position) {
    // Eight thin views around.
    double sum = 0;
    for (int i = 0; i < 8; ++i) {
      const ViewFrustum view{symmetric_slopes(kPi / 4, 1e-3),
                             Eigen::AngleAxisd(i * kPi / 4, Vector3d::UnitY()).toRotationMatrix()};
      sum += 1 - combined.recorded_share(position, view);
    }
    return sum / 8;
  };
  // (half + y) / (distance - x) <= 1 for each side: the thesis says that some rays are never
  // captured, but in its plane an octagon of 90 degrees has a range of motion.
  EXPECT_NEAR(missing({0, 0, 0}), 0, 1e-9);
  EXPECT_NEAR(missing({0.2, 0, 0}), 0, 1e-9);
  EXPECT_GT(missing({0.3, 0, 0}), 0.01);
  EXPECT_GT(missing({0.4, 0, 0.1}), 0.05);
}

// Ten thousand kilometres from the world's origin and at one millimetre the shares are the same.
TEST(CombinedArrays, StaysExactFarAway) {
  const Vector3d far(1e7, -1e7, 1e7);
  for (const double l : {1e-3, 0.4, 1e3}) {
    const CombinedArrays near(box(l, 0.8 * l, 0.8), true), away(box(l, 0.8 * l, 0.8, far), true);
    const Vector3d at(0.1 * l, -0.2 * l, 0.05 * l);
    EXPECT_NEAR(away.recorded_share_of_all(far + at), near.recorded_share_of_all(at),
                1e-8 + 1e-8 / l);
  }
  // Two arrays in one plane, with different lenses: neither is in front of the other.
  const Vector3d ahead = Vector3d(1, 2, -3).normalized();
  const std::vector<MemberArray> overlapping{side_of_box(ahead, 0.1, 0.5, 0.4, far),
                                             side_of_box(ahead, 0.1, 0.4, 0.7, far)};
  EXPECT_NEAR(CombinedArrays(overlapping, true).recorded_share_of_all(far),
              CombinedArrays(overlapping, false).recorded_share_of_all(far), 1e-12);
}

// On an edge of an array no direction counts twice.
TEST(CombinedArrays, PositionsOnEdgesAndCornersHaveASide) {
  const CombinedArrays one({side_of_box(-Vector3d::UnitZ(), 0, 0.5, 0.6)}, false);
  const double whole = one.recorded_share_of_all(Vector3d::Zero());
  EXPECT_GT(whole, 0.05);
  for (const Vector3d& at : {Vector3d(0.5, 0, 0), Vector3d(0.5, 0.5, 0), Vector3d(-0.5, 0.2, 0)}) {
    EXPECT_NEAR(one.recorded_share_of_all(at), whole, 1e-12) << at.transpose();
  }
  EXPECT_EQ(one.recorded_share_of_all({0.6, 0, 0}), 0);
}

/// The obvious way for seen_point().
bool is_seen(const std::vector<MemberArray>& arrays, bool hide, const Vector3d& point,
             const Vector3d& direction) {
  for (std::size_t i = 0; i < arrays.size(); ++i) {
    const auto t = crossing(arrays[i], arrays[i].rays.hull, point, direction);
    if (!t || *t > 0 || !sees_slope(arrays[i], direction)) continue;
    bool is_hidden = false;
    for (std::size_t j = 0; j < arrays.size() && hide; ++j) {
      const auto other = crossing(arrays[j], arrays[j].outline, point, direction);
      is_hidden = is_hidden || (j != i && other && *other > *t && *other < 0);
    }
    if (!is_hidden) return true;
  }
  return false;
}

TEST(CombinedArrays, PointsAreSeenAsRandomRaysSay) {
  std::mt19937 random(20051);
  std::uniform_real_distribution<double> unit(-1, 1);
  std::normal_distribution<double> any;
  for (int trial = 0; trial < 12; ++trial) {
    // They look inwards, or anywhere.
    std::vector<MemberArray> arrays;
    for (int i = 0; i < 4; ++i) {
      const Vector3d direction = Vector3d(any(random), any(random), any(random)).normalized();
      arrays.push_back(
          side_of_box(direction, (trial % 2 == 0 ? -1 : 1) * (0.4 + 0.2 * i), 0.5, 0.7));
    }
    const Vector3d point = 0.2 * Vector3d(unit(random), unit(random), unit(random));
    for (const bool hide : {false, true}) {
      constexpr int kRays = 50'000;
      int seen = 0;
      for (int ray = 0; ray < kRays; ++ray) {
        const Vector3d direction = Vector3d(any(random), any(random), any(random)).normalized();
        seen += is_seen(arrays, hide, point, direction) ? 1 : 0;
      }
      EXPECT_NEAR(CombinedArrays(arrays, hide).seen_point(point).share,
                  static_cast<double>(seen) / kRays, 5 * std::sqrt(0.25 / kRays))
          << trial << hide;
    }
  }
  // Two arrays that face each other see what is between them; one in front hides it.
  const std::vector<MemberArray> facing{side_of_box(-Vector3d::UnitZ(), -1, 0.5, 0.7),
                                        side_of_box(Vector3d::UnitZ(), -1, 0.5, 0.7)};
  EXPECT_EQ(CombinedArrays(facing, true).seen_point(Vector3d::Zero()).arrays, 2);
  std::vector<MemberArray> blocked = facing;
  blocked.push_back(side_of_box(Vector3d::UnitZ(), 0.5, 3, 0.7));  // looks away from the point
  EXPECT_EQ(CombinedArrays(blocked, true).seen_point(Vector3d::Zero()).arrays, 1);
}

}  // namespace
}  // namespace raystage::rig
