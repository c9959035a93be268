// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "render/depth/warp.h"
#include "testing/render/exact_geometry.h"
#include "testing/render/geometry_generators.h"
#include "testing/render/transfer_probe.h"
#include "testing/render/worst_error.h"
#include "testing/test_simd_targets.h"

namespace raystage::render {
namespace {

using Eigen::Vector3d;
using testing::between;
using testing::exact;
using testing::exact_ray;
using testing::ExactVector;
using testing::off;
using testing::ray_term_magnitude;
using testing::Real;
using testing::WorstError;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kFloatEpsilon = std::numeric_limits<float>::epsilon();
constexpr int kMaxLanes = 16;

/// Two cameras, and a pixel of the first one with a depth; the second looks roughly there.
struct Shot {
  VirtualCamera from, to;
  int x = 0, y = 0;
  float inverse_depth = 0;
};

Shot some_shot() {
  Shot shot;
  shot.from = testing::random_view(testing::random_pose(testing::random_origin(), 1));
  shot.x = *rc::gen::inRange(0, shot.from.width);
  shot.y = *rc::gen::inRange(0, shot.from.height);
  shot.inverse_depth = *rc::gen::element(0.0F, 1e-12F, 1e-9F, 1e-6F, 0.01F, 0.25F, 10.0F, 1e3F);
  const rig::Pose& pose = shot.from.pose;
  const double apart = *rc::gen::element(0.0, 1e-12, 1e-3, 0.1, 5.0, 1e6);
  rig::Pose other{pose.world_from_camera_rotation, pose.position + apart * testing::direction()};
  const ExactVector ray = exact_ray(shot.from, shot.x + 0.5, shot.y + 0.5);
  const Vector3d rounded(static_cast<double>(ray.x), static_cast<double>(ray.y),
                         static_cast<double>(ray.z));
  const Vector3d way =
      rounded + static_cast<double>(shot.inverse_depth) * (pose.position - other.position);
  const int kind = *rc::gen::inRange(0, 6);  // as the first, any, or towards the point
  if (kind == 0) other.world_from_camera_rotation = testing::rotation();
  if (kind > 1) {
    other.world_from_camera_rotation = testing::rotation_towards(
        Vector3d::Zero(), way.normalized() + between(0, 0.3) * testing::direction());
  }
  shot.to = testing::random_view(other);
  return shot;
}

struct Place {
  Real u, v, inverse_depth;
};
std::optional<Place> exact_place(const Shot& shot) {
  const ExactVector ray = exact_ray(shot.from, shot.x + 0.5, shot.y + 0.5);
  const Vector3d looks = shot.to.pose.viewing_direction();
  ExactVector towards = ray;
  Real inverse_depth = 0;
  if (shot.inverse_depth > 0) {
    const Real depth = 1 / Real(shot.inverse_depth);
    towards = (exact(shot.from.pose.position) + depth * ray) - exact(shot.to.pose.position);
    const Real ahead = dot(exact(looks), towards);
    if (ahead <= 0) return std::nullopt;
    inverse_depth = 1 / ahead;
  }
  const auto pixel = testing::exact_projection(shot.to.intrinsics, shot.to.pose, towards);
  if (!pixel) return std::nullopt;
  return Place{(*pixel)[0], (*pixel)[1], inverse_depth};
}

/// (X, Y, W) of PixelTransfer in double, and the magnitudes of their terms.
struct Sum {
  std::array<double, 3> value{}, terms{};
};
Sum sum_of(const PixelTransfer& t, const Shot& shot) {
  Sum sum;
  const double x = shot.x + 0.5, y = shot.y + 0.5, q = static_cast<double>(shot.inverse_depth);
  for (std::size_t r = 0; r < 3; ++r) {
    const double* m = &t.direction[3 * r];
    sum.value[r] = m[0] * x + (m[1] * y + m[2]) + q * t.parallax[r];
    // Computed in float: the pixel's ray, its offset from a vector's first pixel, and the parallax.
    sum.terms[r] = std::abs(m[0] * x + (m[1] * y + m[2])) + kMaxLanes * std::abs(m[0]) +
                   std::abs(q * t.parallax[r]);
  }
  return sum;
}

struct Bound {
  double position = 0;  ///< pixels
  double depth = 0;     ///< inverse, relative
};

/// Returns the bound of the error in double: two rotations of the ray, and the offset of the
/// cameras. Large angles and cancellation of W raise the bound.
Bound bound_in_double(const Shot& shot, const Sum& sum) {
  const double away = (shot.from.pose.position - shot.to.pose.position).norm();
  const double terms = ray_term_magnitude(shot.from, shot.x + 0.5, shot.y + 0.5) +
                       static_cast<double>(shot.inverse_depth) * away;
  const double w = sum.value[2];
  const double u = std::max(std::abs(sum.value[0]), std::abs(sum.value[1])) / w;
  const schemas::Intrinsics& k = shot.to.intrinsics;
  return {16 * kEpsilon * (k.fx + k.cx + k.cy + u) * terms / w, 16 * kEpsilon * terms / w};
}

Bound bound_in_float(const Shot& shot, const Sum& sum) {
  const double w = sum.value[2], of_w = sum.terms[2] / w;
  double position = 0;
  for (const std::size_t r : {0, 1}) {
    position = std::max(position, sum.terms[r] / w + std::abs(sum.value[r]) / w * (1 + of_w));
  }
  const Bound rounded = bound_in_double(shot, sum);
  return {2 * kFloatEpsilon * position + rounded.position,
          2 * kFloatEpsilon * (1 + of_w) + rounded.depth};
}

TEST(TransferExtremes, PositionsAndDepthsAreThoseOf50Digits) {
  WorstError position("transfer: position, px", 1e-3), depth("transfer: depth, relative", 1e-6);
  EXPECT_TRUE(rc::check("any two cameras, pixel and depth", [&] {
    const Shot shot = some_shot();
    const Sum sum = sum_of(pixel_transfer(shot.to, shot.from), shot);
    for (const double part : sum.value) RC_ASSERT(std::isfinite(part));
    const auto truth = exact_place(shot);
    const double w = sum.value[2];
    if (!truth || !(w > 0)) {  // behind the camera or near its plane
      const double away = (shot.from.pose.position - shot.to.pose.position).norm();
      const double terms = ray_term_magnitude(shot.from, shot.x + 0.5, shot.y + 0.5) +
                           static_cast<double>(shot.inverse_depth) * away;
      if (truth || w > 0) RC_ASSERT(std::abs(w) <= 16 * kEpsilon * terms);
      return;
    }
    const Bound bound = bound_in_double(shot, sum);
    position.expect(std::max(off(sum.value[0] / w, truth->u), off(sum.value[1] / w, truth->v)),
                    bound.position);
    if (shot.inverse_depth == 0) return;
    depth.expect(static_cast<double>(abs(
                     Real(static_cast<double>(shot.inverse_depth) / w) / truth->inverse_depth - 1)),
                 bound.depth);
  }));
}

TEST(TransferExtremes, OfTheKernelsAreThoseOf50Digits) {
  testing::for_each_simd_target(testing::transfer_target, [] {
    const std::string target = testing::transfer_target();
    WorstError position(target + ": position, px", 1), depth(target + ": depth, relative", 1e-3);
    EXPECT_TRUE(rc::check("any two cameras, pixel and depth", [&] {
      const Shot shot = some_shot();
      const PixelTransfer transfer = pixel_transfer(shot.to, shot.from);
      const auto found = testing::probe_transfer(transfer, shot.x, shot.y, shot.inverse_depth,
                                                 shot.to.width, shot.to.height);
      RC_ASSERT(std::isfinite(found.u) && std::isfinite(found.v));
      const auto truth = exact_place(shot);
      const Sum sum = sum_of(transfer, shot);
      if (!truth || !(sum.value[2] > 0)) {
        if (found.inside) RC_ASSERT(std::abs(sum.value[2]) <= 4 * kFloatEpsilon * sum.terms[2]);
        return;
      }
      const Bound bound = bound_in_float(shot, sum);
      const Real to_border = std::min(
          {truth->u, Real(shot.to.width - truth->u), truth->v, Real(shot.to.height - truth->v)});
      if (to_border > bound.position && bound.depth < 0.5) RC_ASSERT(found.inside);
      if (to_border < -bound.position) RC_ASSERT(!found.inside || bound.depth >= 0.5);
      if (!found.inside || bound.depth >= 0.5) return;
      RC_ASSERT(std::isfinite(found.inverse_depth) && found.inverse_depth >= 0);
      position.expect(std::max(off(double{found.u}, truth->u), off(double{found.v}, truth->v)),
                      bound.position);
      if (shot.inverse_depth == 0) {
        RC_ASSERT(found.inverse_depth == 0);
        return;
      }
      depth.expect(
          static_cast<double>(abs(Real(double{found.inverse_depth}) / truth->inverse_depth - 1)),
          bound.depth);
    }));
  });
}

TEST(TransferExtremes, APointIsPutDownWhere50DigitsSeeIt) {
  testing::for_each_simd_target(testing::transfer_target, [] {
    int put_down = 0;
    EXPECT_TRUE(rc::check("any two cameras, pixel and depth", [&] {
      Shot shot = some_shot();
      InverseDepthMap map(shot.from.width, shot.from.height, kUnknownDepth);
      map.values[static_cast<std::size_t>(shot.y) * static_cast<std::size_t>(map.width) +
                 static_cast<std::size_t>(shot.x)] = shot.inverse_depth;
      const std::vector<std::uint8_t> wanted(depth_tile_count(shot.to), 1);
      const DepthTiles tiles = warp_depths(map, shot.from, shot.to, wanted);
      const InverseDepthMap blocks = block_nearest_depths(map);
      RC_ASSERT(warp_depths(map, shot.from, shot.to, wanted, &blocks).values == tiles.values);
      RC_ASSERT(std::ranges::all_of(tiles.values, [](float v) { return std::isfinite(v); }));

      const auto truth = exact_place(shot);
      const Sum sum = sum_of(pixel_transfer(shot.to, shot.from), shot);
      if (!truth || !(sum.value[2] > 0)) return;
      // The kernel's positions are relative to a few pixels outside of the border.
      const Bound in_float = bound_in_float(shot, sum);
      const Bound bound{in_float.position + 2 * kMaxSplatSize * in_float.depth, in_float.depth};
      if (bound.depth >= 0.5 || truth->u < 0 || truth->v < 0 || truth->u >= shot.to.width ||
          truth->v >= shot.to.height) {
        return;
      }
      const auto column = static_cast<int>(truth->u), row = static_cast<int>(truth->v);
      const Real across = truth->u - column, down = truth->v - row;
      if (std::min({across, Real(1 - across), down, Real(1 - down)}) <= bound.position) return;
      const double focal_ratio = std::max(shot.to.intrinsics.fx / shot.from.intrinsics.fx,
                                          shot.to.intrinsics.fy / shot.from.intrinsics.fy);
      const double extent = focal_ratio / sum.value[2];
      if (extent > 0.99 * double{kSinglePixelFootprint} && extent < 2)
        return;  // may leave its own pixel out
      ++put_down;
      const auto tile = static_cast<std::size_t>(
          (row >> kDepthTileLog2) * depth_tile_columns(shot.to) + (column >> kDepthTileLog2));
      const float found = tiles.row(tile, row % kDepthTile)[column % kDepthTile];
      RC_ASSERT(found >= 0);
      if (shot.inverse_depth == 0) {
        RC_ASSERT(found == 0);
      } else {
        RC_ASSERT(abs(Real(double{found}) / truth->inverse_depth - 1) <= bound.depth);
      }
      if (extent > 1) return;
      // A single pixel: no other pixel is written in any tile.
      const auto of_tiles = tiles.values.begin() + kDepthTile * kDepthTile;
      RC_ASSERT(
          std::count_if(of_tiles, tiles.values.end(), [](float value) { return value >= 0; }) == 1);
    }));
    EXPECT_GT(put_down, 5);  // else nothing was tested
  });
}

}  // namespace
}  // namespace raystage::render
