// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>

#include "testing/render/exact_geometry.h"
#include "testing/render/geometry_generators.h"
#include "testing/render/position_probe.h"
#include "testing/render/worst_error.h"
#include "testing/test_simd_targets.h"

namespace raystage::render::positions_extremes_test {
namespace {

using Eigen::Vector3d;
using testing::between;
using testing::exact;
using testing::exact_ray;
using testing::ExactVector;
using testing::off;
using testing::Real;
using testing::WorstError;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kFloatEpsilon = std::numeric_limits<float>::epsilon();
constexpr int kWidth = 640, kHeight = 480;
constexpr schemas::Distortion kLens{-0.2, 0.05, 0.001, -0.002, 0.003};

/// A view, a camera that sees a part of it, and planes.
struct Shot {
  VirtualCamera view;
  rig::Rig::Camera camera;
  SweepPlanes planes;
  int begin = 0, count = 0, y = 0;  ///< a block of the view's pixels
};

Shot some_shot() {
  const double nearest = *rc::gen::element(1e-9, 1e-6, 0.01, 0.25, 10.0, 1e3);
  SweepPlanes planes{*rc::gen::element(1, 5, 33), 0, 0};
  planes.farthest = *rc::gen::element(0.0, 0.5, 0.999999, 1.0) * nearest;
  if (planes.count > 1) planes.step = (nearest - planes.farthest) / (planes.count - 1);

  schemas::CameraGeometry geometry;
  geometry.id = "c";
  geometry.width = kWidth;
  geometry.height = kHeight;
  geometry.intrinsics = {500, 510, 320.5, 240,
                         *rc::gen::arbitrary<bool>() ? kLens : schemas::Distortion{}};
  const Vector3d around = testing::random_origin();
  rig::Pose eye = testing::random_pose(around, 1);
  Shot shot{testing::random_view(eye), {"c", rig::CameraModel(geometry), {}, {}, {}, {}}, planes};
  shot.count = std::min(*rc::gen::element(1, 2, 17, kCostBlockSize), shot.view.width);
  shot.begin = *rc::gen::inRange(0, shot.view.width - shot.count + 1);
  shot.y = *rc::gen::inRange(0, shot.view.height);

  const double apart = *rc::gen::element(0.0, 1e-12, 1e-3, 0.1, 5.0, 1e6);
  shot.camera.pose.position = eye.position + apart * testing::direction();
  const ExactVector ray = exact_ray(shot.view, shot.begin + 0.5 * shot.count, shot.y + 0.5);
  const Vector3d rounded(static_cast<double>(ray.x), static_cast<double>(ray.y),
                         static_cast<double>(ray.z));
  const Vector3d way = rounded + planes.nearest() * (eye.position - shot.camera.pose.position);
  shot.camera.pose.world_from_camera_rotation = testing::rotation_towards(
      Vector3d::Zero(), way.normalized() + between(0, 0.3) * testing::direction());
  if (*rc::gen::arbitrary<bool>())
    shot.camera.pose.world_from_camera_rotation *=
        Eigen::AngleAxisd(between(-3, 3), Vector3d::UnitZ()).toRotationMatrix();
  return shot;
}

/// The position at which the camera sees a pixel's point on a plane, and its rounding in float.
struct Place {
  Real u, v;
  double bound = 0;  ///< pixels
};
std::optional<Place> exact_place(const Shot& shot, const DepthSource& source, int x, int plane) {
  const double pixel_x = shot.begin + x + 0.5, pixel_y = shot.y + 0.5;
  const Real q = Real(shot.planes.farthest) + plane * Real(shot.planes.step);
  const Vector3d& eye = shot.view.pose.position;
  const Vector3d& centre = shot.camera.pose.position;
  const ExactVector ray = exact_ray(shot.view, pixel_x, pixel_y);
  const ExactVector towards = q == 0 ? ray : q * ((exact(eye) + 1 / q * ray) - exact(centre));
  const auto pixel =
      testing::exact_projection(shot.camera.model.intrinsics(), shot.camera.pose, towards);
  const double ahead =
      static_cast<double>(dot(exact(shot.camera.pose.viewing_direction()), towards));
  if (!pixel) return std::nullopt;
  // Three terms in float: the block's first pixel on the farthest plane (exact in double), and the
  // offsets along the block and across the planes.
  double terms = 0;
  for (std::size_t r = 0; r < 3; ++r) {
    const double* m = &source.camera.ideal_from_pixel[3 * r];
    const double deep = source.per_inverse_depth[r];
    const double first =
        m[0] * (shot.begin + 0.5) + m[1] * pixel_y + m[2] + shot.planes.farthest * deep;
    terms = std::max(
        terms, std::abs(first) + std::abs(m[0] * x) + std::abs(shot.planes.step * deep * plane));
  }
  const double in_double = testing::ray_term_magnitude(shot.view, pixel_x, pixel_y) +
                           static_cast<double>(q) * (eye - centre).norm();
  const double size = 500 + 320 + 640;  // focal length, principal point, and distance from it
  return Place{(*pixel)[0], (*pixel)[1],
               2 * size * (2 * kFloatEpsilon * terms + 16 * kEpsilon * in_double) / ahead};
}

TEST(BlockPositionsExtremes, AreThoseOf50Digits) {
  store::DecodedFrame frame;
  frame.width = kWidth;
  frame.height = kHeight;
  frame.rgba = std::make_unique<std::uint16_t[]>(4 * (kWidth * (kHeight + 1) + 1));
  const MatchingFrame matching(frame, {store::BlendSpace::kPerceptual, 1}, {0, kWidth, 0, kHeight});
  testing::for_each_simd_target(cost_kernel_target, [&] {
    const std::string target = cost_kernel_target();
    WorstError by_fit(target + ": position by a block's parabola, px", 0.01),
        by_itself(target + ": position by itself, px", 0.01);
    EXPECT_TRUE(rc::check("any view, camera, planes and block", [&] {
      const Shot shot = some_shot();
      const MatchingCamera camera{depth_source(shot.view, shot.camera), &matching};
      CostRun run;
      run.y = shot.y;
      run.planes = shot.planes;
      const auto found = testing::probe_positions(camera, run, shot.begin, shot.count);
      for (int plane = 0; plane < shot.planes.count; plane += std::max(1, shot.planes.count / 5)) {
        for (int x = 0; x < shot.count; x += 1 + shot.count / 9) {
          const auto& place = found[plane * shot.count + x];
          RC_ASSERT(std::isfinite(place.u) && std::isfinite(place.v));
          const auto truth = exact_place(shot, camera.source, x, plane);
          if (!truth || truth->bound > 0.5) continue;
          const Real to_border =
              std::min({truth->u, Real(kWidth - truth->u), truth->v, Real(kHeight - truth->v)});
          if (to_border > 0.5 + truth->bound) RC_ASSERT(place.seen);
          if (!place.seen || to_border < 0.5) continue;  // clamped to the outermost pixel centres
          const double error_u = off(place.u, truth->u), error_v = off(place.v, truth->v);
          // Rounded to 1/256 and 1/4096 of a pixel.
          if (!place.by_fit) {
            by_itself.expect(error_u, 0.5 / 256 + truth->bound);
            by_itself.expect(error_v, 0.5 / 4096 + truth->bound);
            continue;
          }
          by_fit.expect(error_u, 1.0 / 256 + 2 * truth->bound);
          by_fit.expect(error_v, 1.0 / 256 + 2 * truth->bound);
        }
      }
    }));
  });
}

}  // namespace
}  // namespace raystage::render::positions_extremes_test
