// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <cmath>
#include <limits>
#include <memory>
#include <optional>
#include <vector>

#include "render/hull/hull_surface.h"
#include "testing/render/exact_geometry.h"
#include "testing/render/geometry_generators.h"
#include "testing/render/worst_error.h"

namespace raystage::render {
namespace {

using Eigen::Vector3d;
using testing::between;
using testing::exact;
using testing::ExactVector;
using testing::Real;
using testing::WorstError;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

/// An array and a ray that may cross its field of view.
struct Shot {
  rig::Rig rig;
  WorldRay ray;
  double nearest = 0;  ///< metres from the eye
};

Shot some_shot() {
  const int width = *rc::gen::element(1, 64, 640, 16384);
  Shot shot{testing::random_rig(width, width > 640 ? 2 : std::min(width, 480)), {}, 0};
  const auto& cameras = shot.rig.cameras;
  const rig::Pose& aimed_at_by = cameras[*rc::gen::inRange<std::size_t>(0, cameras.size())].pose;
  const double depth = *rc::gen::element(1e-3, 0.1, 4.0, 1e3, 1e9);
  const Vector3d target =
      aimed_at_by.world_from_camera(depth * Vector3d(between(-0.7, 0.7), between(-0.5, 0.5), -1));
  // On the array's plane, near it, in front of and behind it, and at the side of its field of view.
  const double height = *rc::gen::element(0.0, 1e-12, -1e-12, 0.1, -0.3, 10.0, 1e6, -1e6);
  const double aside = *rc::gen::element(0.0, 0.01, 1.0, 1e6);
  shot.ray.origin = aimed_at_by.world_from_camera({0, 0, height}) + aside * testing::direction();
  const Vector3d way = target - shot.ray.origin;
  RC_PRE(way.norm() > 0);
  shot.ray.direction = way.normalized();
  shot.nearest = *rc::gen::element(1e-6, 0.1, 0.1, 10.0);
  return shot;
}

/// A linear function of the inverse distance along a ray.
struct Line {
  Real at_infinity, per_inverse;
  Real at(const Real& q) const { return at_infinity + q * per_inverse; }
};

/// What a camera sees along a ray: its pixel is (x / w, y / w), where w is above 0.
struct Track {
  Line x, y, w;
};
Track track_of(const rig::Rig::Camera& camera, const WorldRay& ray) {
  const Eigen::Matrix3d& r = camera.pose.world_from_camera_rotation;
  const ExactVector along = exact(ray.direction),
                    to_eye = exact(ray.origin) - exact(camera.pose.position);
  const auto part = [&](Eigen::Index axis, double sign) {
    return Line{sign * dot(exact(r.col(axis)), along), sign * dot(exact(r.col(axis)), to_eye)};
  };
  const Line right = part(0, 1), down = part(1, -1), ahead = part(2, -1);
  const schemas::Intrinsics& k = camera.model.intrinsics();
  const auto mixed = [&](const Line& a, double focal, double centre) {
    return Line{focal * a.at_infinity + centre * ahead.at_infinity,
                focal * a.per_inverse + centre * ahead.per_inverse};
  };
  return {mixed(right, k.fx, k.cx), mixed(down, k.fy, k.cy), ahead};
}

/// Inverse distances between which a camera sees the ray, and the rounding of both ends.
struct Stretch {
  Real far, near;
  double far_bound = 0, near_bound = 0;
};

/// Returns the rounding error of the end of a stretch. A pixel is a quotient of sums of the ray's
/// direction and the offset of the eye, which may cancel. The end moves by the rounding of the
/// pixel divided by the pixel's speed along the inverse distance. The inverse distance is rounded
/// too.
double end_bound(const rig::Rig::Camera& camera, const WorldRay& ray, const Track& track,
                 const Real& q) {
  const Real w = track.w.at(q);
  const Real x = (track.x.per_inverse * w - track.x.at(q) * track.w.per_inverse) / (w * w);
  const Real y = (track.y.per_inverse * w - track.y.at(q) * track.w.per_inverse) / (w * w);
  const double speed = static_cast<double>(std::max(Real(abs(x)), Real(abs(y))));
  const double inverse = static_cast<double>(q);
  const double away = (camera.pose.position - ray.origin).norm();
  const schemas::Intrinsics& k = camera.model.intrinsics();
  const double size = k.fx + camera.model.width() + camera.model.height();
  const double pixels = 16 * kEpsilon * size * (1 + (1 + inverse * away) / static_cast<double>(w));
  return pixels / speed + 8 * kEpsilon * inverse;
}

/// Returns the interval of inverse distances, 0 to `most`, in which the ray's pixel is in [left,
/// width] x [0, height]. It is computed by the crossings with each border; nullopt if it is empty.
std::optional<Stretch> exact_stretch(const rig::Rig::Camera& camera, const WorldRay& ray,
                                     const Real& left, const Real& most) {
  const Track track = track_of(camera, ray);
  Stretch stretch{0, most};
  bool empty = false;
  const auto keep = [&](const Line& line) {  // where it is not below 0
    if (line.per_inverse == 0) {
      empty = empty || line.at_infinity < 0;
      return;
    }
    const Real border = -line.at_infinity / line.per_inverse;
    if (line.per_inverse > 0) {
      stretch.far = std::max(stretch.far, border);
    } else {
      stretch.near = std::min(stretch.near, border);
    }
  };
  const auto minus = [](const Line& a, const Real& factor, const Line& b) {
    return Line{a.at_infinity - factor * b.at_infinity, a.per_inverse - factor * b.per_inverse};
  };
  const auto negative = [](const Line& a) { return Line{-a.at_infinity, -a.per_inverse}; };
  keep(track.w);
  keep(minus(track.x, left, track.w));
  keep(negative(minus(track.x, Real(camera.model.width()), track.w)));
  keep(track.y);
  keep(negative(minus(track.y, Real(camera.model.height()), track.w)));
  if (empty || stretch.far > stretch.near) return std::nullopt;
  stretch.far_bound = end_bound(camera, ray, track, stretch.far);
  stretch.near_bound = end_bound(camera, ray, track, stretch.near);
  return stretch;
}

/// Returns the nearest point in at least `least` stretches, or nullopt. Widens each stretch by
/// `margin` (-1, 0 or 1) times its rounding.
std::optional<Real> first_held(const std::vector<std::optional<Stretch>>& stretches, int least,
                               int margin) {
  std::vector<Stretch> shifted;
  for (const auto& stretch : stretches) {
    if (!stretch) continue;
    Stretch s = *stretch;
    s.near += margin * s.near_bound;
    s.far -= margin * s.far_bound;
    if (s.far <= s.near) shifted.push_back(s);
  }
  std::optional<Real> first;
  for (const Stretch& candidate : shifted) {
    const auto holds = std::ranges::count_if(shifted, [&](const Stretch& s) {
      return s.far <= candidate.near && candidate.near <= s.near;
    });
    if (holds >= least && (!first || candidate.near > *first)) first = candidate.near;
  }
  return first;
}

std::shared_ptr<const Matte> matte_of(const rig::CameraModel& model, int first_column) {
  std::vector<std::uint8_t> codes;
  for (int y = 0; y < model.height(); ++y) {
    for (int x = 0; x < model.width(); ++x) codes.push_back(x >= first_column ? 255 : 0);
  }
  return std::make_shared<const Matte>(model, std::move(codes), 0.5);
}

double meet(const Shot& shot, const std::vector<Silhouette>& silhouettes, int min_views) {
  double inverse_distance = -1;
  hull_surface(shot.rig, silhouettes, min_views, shot.nearest)({&shot.ray, 1},
                                                               {&inverse_distance, 1});
  return inverse_distance;
}

/// Expects `found` between the bounds. `error`: its difference from their middle.
void expect_between(double found, const std::optional<Real>& least,
                    const std::optional<Real>& most) {
  const auto beyond = [&](const std::optional<Real>& end) {
    return end ? static_cast<double>((Real(found) - *end) / *end) : -1;
  };
  RC_LOG() << "found " << found << ", beyond the least by " << beyond(least)
           << " of it, beyond the most by " << beyond(most) << '\n';
  RC_ASSERT(!std::isinf(found));
  if (std::isnan(found)) {
    RC_ASSERT(!least.has_value());
    return;
  }
  RC_ASSERT(most.has_value());
  RC_ASSERT(Real(found) <= *most);
  if (least) RC_ASSERT(Real(found) >= *least);
}

TEST(CarvingExtremes, WhatCamerasSeeBeginsWhere50DigitsSeeIt) {
  WorstError relative("hull: inverse distance, relative", 1e-6);
  int met = 0, missed = 0;
  EXPECT_TRUE(rc::check("any array and ray", [&] {
    const Shot shot = some_shot();
    const auto matte = matte_of(shot.rig.cameras[0].model, 0);
    std::vector<Silhouette> silhouettes;
    std::vector<std::optional<Stretch>> stretches;
    const Real most = 1 / Real(shot.nearest);
    for (std::size_t i = 0; i < shot.rig.cameras.size(); ++i) {
      silhouettes.push_back({static_cast<int>(i), matte});
      stretches.push_back(exact_stretch(shot.rig.cameras[i], shot.ray, 0, most));
    }
    const int min_views = *rc::gen::inRange(1, static_cast<int>(silhouettes.size()) + 1);
    const double found = meet(shot, silhouettes, min_views);
    const auto least = first_held(stretches, min_views, -1);
    const auto at_most = first_held(stretches, min_views, 1);
    expect_between(found, least, at_most);
    std::isnan(found) ? ++missed : ++met;
    const auto truth = first_held(stretches, min_views, 0);
    if (!truth || !least || !at_most || !(found > 0)) return;
    relative.expect(testing::off(found, *truth) / found,
                    static_cast<double>(*at_most - *least) / found);
  }));
  EXPECT_GT(met, 20);
  EXPECT_GT(missed, 5);
}

TEST(CarvingExtremes, LookingForWhatIsNextToTheEyeHidesNothing) {
  schemas::RigDocument document;
  for (const auto& camera : testing::camera_grid(1, 1, 1, 640, 480)) {
    document.cameras.push_back({camera, {}});
  }
  Shot shot{rig::rig_from_document(document), {}, 0.1};
  const std::vector<Silhouette> all{{0, matte_of(shot.rig.cameras[0].model, 0)}};
  // The eye is in the camera's plane, where the ray's depth is constant, or far away.
  for (const Vector3d& eye : {Vector3d(5, 0, 0), Vector3d(1e6, 0, 0), Vector3d(-1e6, 10, 1e5)}) {
    shot.ray = {eye, (Vector3d(0, 0, -4) - eye).normalized()};
    shot.nearest = 0.1;
    const double found = meet(shot, all, 1);
    ASSERT_GT(found, 0);
    for (const double nearest : {1e-3, 1e-6}) {
      shot.nearest = nearest;
      EXPECT_NEAR(meet(shot, all, 1) / found, 1, 1e-14) << eye.transpose() << ", " << nearest;
    }
  }
}

TEST(CarvingExtremes, AnEdgeIsCutWithinAPixelOfWhere50DigitsSeeIt) {
  int met = 0;
  EXPECT_TRUE(rc::check("any camera, silhouette and ray", [&] {
    Shot shot = some_shot();
    shot.rig.cameras.erase(shot.rig.cameras.begin() + 1, shot.rig.cameras.end());
    const rig::Rig::Camera& camera = shot.rig.cameras[0];
    const Real most = 1 / Real(shot.nearest);
    for (const int parts : {1, 2, 3, 4, 5, 6, 7}) {
      const int column = camera.model.width() * parts / 8;
      const double found = meet(shot, {{0, matte_of(camera.model, column)}}, 1);
      const auto first = [&](int left, int margin) {
        return first_held({exact_stretch(camera, shot.ray, std::max(0, left), most)}, 1, margin);
      };
      expect_between(found, first(column + 1, -1), first(column - 1, 1));
      met += std::isnan(found) ? 0 : 1;
    }
  }));
  EXPECT_GT(met, 10);
}

}  // namespace
}  // namespace raystage::render
