// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>

#include "render/common/blending_field.h"
#include "testing/render/exact_geometry.h"
#include "testing/render/geometry_generators.h"
#include "testing/render/worst_error.h"

namespace raystage::render {
namespace {

using Eigen::Vector3d;
using testing::between;
using testing::exact;
using testing::exact_ray;
using testing::ExactVector;
using testing::Real;
using testing::WorstError;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kInfinity = std::numeric_limits<double>::infinity();

struct Shot {
  rig::Rig rig;
  VirtualCamera view;
  schemas::DepthRange scene;
};

Shot some_shot() {
  Shot shot{testing::random_rig(), {}, {}};
  const double near = *rc::gen::element(1e-3, 0.1, 4.0, 1e6, 1e9);
  shot.scene = {near, *rc::gen::element(near, near * (1 + 1e-12), 2 * near, 1e12, kInfinity)};
  const rig::Pose& camera = shot.rig.cameras[0].pose;
  // On the array, on the scene's nearest plane, in the scene, and in front of and behind
  // everything.
  const double ahead = *rc::gen::element(0.0, 1e-12, -0.1, near / 2, near, 1.5 * near, -1e6, 1e6);
  rig::Pose eye{camera.world_from_camera_rotation,
                camera.world_from_camera({between(-0.1, 0.1), between(-0.1, 0.1), -ahead})};
  const int kind = *rc::gen::inRange(0, 3);  // as the array, in any direction, or slightly rotated
  if (kind == 1) eye.world_from_camera_rotation = testing::rotation();
  if (kind == 2) {
    eye.world_from_camera_rotation =
        eye.world_from_camera_rotation *
        Eigen::AngleAxisd(between(-0.5, 0.5), testing::direction()).toRotationMatrix();
  }
  shot.view = testing::random_view(eye);
  return shot;
}

/// Inverse depths at which some ray meets the scene between two planes. `speed` is the distance in
/// metres by which a ray moves away from the array per metre of planar depth. The ray is between
/// the planes at inverse depth q if q (near - eye) <= speed <= q (far - eye). Speeds are linear in
/// the pixel, so those of a view are between the extremes at its corners.
struct ExactRange {
  Real farthest = 0, nearest = 0;
  double farthest_bound = 0, nearest_bound = 0;  ///< rounding errors
  bool rounding_decides = false;                 ///< of whether the range is empty
};

ExactRange exact_range(const Shot& shot) {
  ExactVector centre{0, 0, 0}, axis{0, 0, 0};
  double magnitude = 0;
  for (const rig::Rig::Camera& camera : shot.rig.cameras) {
    centre = centre + exact(camera.pose.position);
    axis = axis + exact(camera.pose.viewing_direction());
    magnitude = std::max(magnitude, camera.pose.position.norm());
  }
  centre = Real(1) / Real(shot.rig.cameras.size()) * centre;
  axis = 1 / norm(axis) * axis;
  const ExactVector from_centre = exact(shot.view.pose.position) - centre;
  const Real eye = dot(from_centre, axis);
  // The array's centre is rounded, and so is the eye's distance from it.
  const double eye_bound =
      4 * kEpsilon * (magnitude + static_cast<double>(norm(from_centre)) + shot.scene.near);
  Real slowest = 0, fastest = 0;
  double speed_bound = 0;
  for (int corner = 0; corner < 4; ++corner) {
    const double x = corner % 2 == 0 ? 0 : shot.view.width, y = corner < 2 ? 0 : shot.view.height;
    const Real speed = dot(axis, exact_ray(shot.view, x, y));
    slowest = corner == 0 ? speed : std::min(slowest, speed);
    fastest = corner == 0 ? speed : std::max(fastest, speed);
    speed_bound =
        std::max(speed_bound, 8 * kEpsilon * testing::ray_term_magnitude(shot.view, x, y));
  }
  const Real to_near = Real(shot.scene.near) - eye;
  const bool endless = std::isinf(shot.scene.far);
  const Real to_far = endless ? Real(0) : Real(shot.scene.far) - eye;
  const double far_bound = endless ? 0 : eye_bound + 2 * kEpsilon * shot.scene.far;

  ExactRange range;
  const Real limit = 4 / Real(shot.scene.near);
  range.nearest = limit;
  range.nearest_bound = 2 * kEpsilon * static_cast<double>(limit);
  // q <= speed / distance (upper) or q >= speed / distance, each with its rounding.
  const auto cut = [&](const Real& speed, const Real& distance, double distance_bound, bool upper) {
    const Real q = speed / distance;
    const double size = std::abs(static_cast<double>(distance));
    if (size <= 2 * distance_bound) {
      range.rounding_decides = true;
      return;
    }
    const double bound =
        2 * (speed_bound + std::abs(static_cast<double>(q)) * distance_bound) / size +
        4 * kEpsilon * std::abs(static_cast<double>(q));
    if (upper && q < range.nearest) {
      range.nearest = q;
      range.nearest_bound = bound;
    } else if (upper && static_cast<double>(q - range.nearest) < bound) {
      range.nearest_bound = std::max(range.nearest_bound, 2 * bound);
    }
    if (!upper && q > range.farthest) {
      range.farthest = q;
      range.farthest_bound = bound;
    } else if (!upper && static_cast<double>(range.farthest - q) < bound) {
      range.farthest_bound = std::max(range.farthest_bound, 2 * bound);
    }
  };
  if (to_near == 0) {  // the eye is on the nearest plane: rays forwards are in the scene
    range.rounding_decides = range.rounding_decides || abs(fastest) <= speed_bound;
    if (fastest < 0) range.nearest = -1;
  } else {
    cut(fastest, to_near, eye_bound, to_near > 0);  // q near <= fastest
  }
  if (endless) return range;
  if (to_far == 0) {
    range.rounding_decides = true;
  } else {
    cut(slowest, to_far, far_bound, to_far < 0);  // q far >= slowest
  }
  return range;
}

TEST(SweepPlanesExtremes, InverseDepthsInViewAreThoseOf50Digits) {
  WorstError ends("inverse depths in view: relative to the nearest", 1e-9);
  int seen = 0, nothing = 0, one_plane = 0;
  EXPECT_TRUE(rc::check("any array, view and scene", [&] {
    const Shot shot = some_shot();
    const InverseDepthRange range = inverse_depth_range_in_view(shot.view, shot.rig, shot.scene);
    RC_ASSERT(!std::isnan(range.farthest) && !std::isnan(range.nearest));
    const ExactRange truth = exact_range(shot);
    const double slack = truth.farthest_bound + truth.nearest_bound;
    if (!range.empty()) {
      RC_ASSERT(range.farthest >= 0 && std::isfinite(range.farthest));
      RC_ASSERT(std::isfinite(range.nearest));
    }
    if (truth.rounding_decides) return;
    if (static_cast<double>(abs(truth.nearest - truth.farthest)) > slack) {
      RC_LOG() << "exactly " << static_cast<double>(truth.farthest) << " to "
               << static_cast<double>(truth.nearest) << ", found " << range.farthest << " to "
               << range.nearest << '\n';
      RC_ASSERT(range.empty() == (truth.nearest < truth.farthest));
    }
    if (range.empty()) {
      ++nothing;
      return;
    }
    ++seen;
    one_plane += shot.scene.near == shot.scene.far ? 1 : 0;
    const double size = range.nearest;
    if (!(size > 0)) return;
    ends.expect(testing::off(range.farthest, truth.farthest) / size, truth.farthest_bound / size);
    ends.expect(testing::off(range.nearest, truth.nearest) / size, truth.nearest_bound / size);
  }));
  EXPECT_GT(seen, 10);
  EXPECT_GT(nothing, 3);
  EXPECT_GT(one_plane, 0);
}

TEST(SweepPlanesExtremes, PlanesAreFiniteAndWhere50DigitsPutThem) {
  WorstError places("planes across a range: relative to the nearest");
  EXPECT_TRUE(rc::check("any array, view and scene", [&] {
    const Shot shot = some_shot();
    const InverseDepthRange range = inverse_depth_range_in_view(shot.view, shot.rig, shot.scene);
    if (range.empty()) return;
    const BlendingField field(shot.view, shot.rig, testing::all_cameras(shot.rig), range, 4);
    const double needed = required_plane_count(range, shot.view, shot.rig, field, 0.5);
    RC_ASSERT(std::isfinite(needed) && needed >= 1);
    const int count = *rc::gen::element(1, 2, 3, 512, static_cast<int>(std::min(needed, 512.0)));
    const SweepPlanes planes = evenly_spaced_planes(range, count);
    RC_ASSERT(planes.count == count);
    const SweepPlanes told = planes.from_farthest();
    for (const int plane : {0, count / 2, count - 1}) {
      const double q = planes.inverse_depth(plane);
      RC_ASSERT(std::isfinite(q) && q >= 0);
      const Real width = Real(range.nearest) - Real(range.farthest);
      const Real truth = count == 1 ? Real((Real(range.farthest) + Real(range.nearest)) / 2)
                                    : Real(range.farthest) + plane * width / (count - 1);
      if (!(range.nearest > 0)) continue;
      places.expect(testing::off(q, truth) / range.nearest, 4 * kEpsilon);
      RC_ASSERT(std::abs(planes.farthest + told.inverse_depth(plane) - q) <=
                kEpsilon * range.nearest);
    }
  }));
}

TEST(SweepPlanesExtremes, ASceneOfOneDepthIsOnePlane) {
  WorstError depth("one plane's depth, relative", 1e-9);
  EXPECT_TRUE(rc::check("any array, and an eye that looks as it does", [&] {
    Shot shot = some_shot();
    shot.scene.far = shot.scene.near;
    const rig::Pose& camera = shot.rig.cameras[0].pose;
    const double behind = *rc::gen::element(0.0, 1e-12, 0.1, 1e6);
    const rig::Pose eye{camera.world_from_camera_rotation,
                        shot.rig.centre() - behind * camera.viewing_direction()};
    shot.view = virtual_camera_with_fov(*rc::gen::element(1, 640, 16384), 2, 1, eye);
    const InverseDepthRange range = inverse_depth_range_in_view(shot.view, shot.rig, shot.scene);
    RC_ASSERT(!range.empty());
    const double q = evenly_spaced_planes(range, 1).inverse_depth(0);
    const ExactRange truth = exact_range(shot);
    depth.expect(static_cast<double>(abs(Real(q) / ((truth.farthest + truth.nearest) / 2) - 1)),
                 (truth.farthest_bound + truth.nearest_bound) / q);
    const BlendingField field(shot.view, shot.rig, testing::all_cameras(shot.rig), range, 4);
    RC_ASSERT(required_plane_count(range, shot.view, shot.rig, field, 0.05) <= 2);
  }));
}

}  // namespace
}  // namespace raystage::render
