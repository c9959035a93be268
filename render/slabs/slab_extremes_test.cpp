// SPDX-License-Identifier: Apache-2.0
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "render/common/ray_cells.h"
#include "render/slabs/slab_rays.h"
#include "render/slabs/slab_runs.h"
#include "testing/render/exact_geometry.h"
#include "testing/render/geometry_generators.h"
#include "testing/render/slab_kernel_probe.h"
#include "testing/render/worst_error.h"
#include "testing/test_simd_targets.h"

namespace raystage::render {
namespace {

using Eigen::Vector3d;
using testing::between;
using testing::direction;
using testing::exact;
using testing::exact_ray;
using testing::ExactVector;
using testing::off;
using testing::ray_term_magnitude;
using testing::Real;
using testing::WorstError;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();
constexpr double kFloatEpsilon = std::numeric_limits<float>::epsilon();
constexpr double kEdge = 1e-9;  // tolerance beyond the edge of the grid, in nodes
constexpr int kChunk = 64;      // pixels that the kernel processes at once

/// A slab, and a view with a focal plane; a ray of the view is aimed at the grid, or outside it.
struct Shot {
  Slab slab;
  VirtualCamera view;
  Eigen::Vector4d plane;
  double x = 0, y = 0;  ///< pixel position of the ray
};

Slab some_slab() {
  Slab slab;
  slab.pose = testing::random_pose(testing::random_origin(), 1);
  slab.columns = *rc::gen::inRange(1, 6);
  slab.rows = *rc::gen::inRange(1, 6);
  const double spacing = *rc::gen::element(1e-3, 0.06, 5.0);
  if (slab.columns > 1) slab.column_spacing = spacing;
  if (slab.rows > 1) slab.row_spacing = 0.8 * spacing;
  slab.width = testing::kProbedWidth;
  slab.height = testing::kProbedHeight;
  slab.image = {500, 510, 320.5, 240, {}};
  return slab;
}

Shot some_shot() {
  Shot shot{some_slab(), {}, {}};
  const auto place = [](int count) {
    const double within = between(0, count - 1);
    return *rc::gen::element(within, std::floor(within), 0.0, count - 1.0, -0.5);
  };
  const double column = place(shot.slab.columns), row = place(shot.slab.rows);
  const rig::Pose& pose = shot.slab.pose;
  const Vector3d target =
      pose.world_from_camera({column * shot.slab.column_spacing, -row * shot.slab.row_spacing, 0});
  const double height = *rc::gen::element(0.0, 1e-12, -1e-12, 1e-3, 0.1, -0.1, 10.0, 1e6, -1e6);
  const double slant = *rc::gen::element(0.0, 0.0, 0.7, 5.0);
  const Vector3d normal = pose.world_from_camera_rotation.col(2);
  rig::Pose eye{testing::rotation(),
                target + height * normal + slant * std::abs(height) * normal.cross(direction())};
  // In the slab's own direction, so that its nodes see what the view sees; or in another.
  const Vector3d ahead = pose.viewing_direction();
  const Vector3d to_target = target - eye.position;
  const double distance_to_target = to_target.norm();
  if (distance_to_target > 1e-6 && *rc::gen::inRange(0, 4) > 0) {
    const Vector3d looks = (to_target.dot(ahead) < 0 ? -to_target : to_target) / distance_to_target;
    eye.world_from_camera_rotation = testing::rotation_towards(
        Vector3d::Zero(), looks + *rc::gen::element(0.0, 0.0, 0.2) * direction());
  } else if (*rc::gen::inRange(0, 4) > 0) {
    eye.world_from_camera_rotation = pose.world_from_camera_rotation;
  }
  shot.view = testing::random_view(eye);
  shot.x = between(0, shot.view.width);
  shot.y = between(0, shot.view.height);
  const Vector3d in_view = eye.camera_from_world(target);
  if (std::abs(in_view.z()) > 1e-3 * in_view.norm()) {  // the line through the target
    const schemas::Intrinsics& k = shot.view.intrinsics;
    shot.x = k.cx - k.fx * in_view.x() / in_view.z();
    shot.y = k.cy + k.fy * in_view.y() / in_view.z();
  }
  const double distance = *rc::gen::element(1e-3, 0.1, 4.0, 4.0, 1e6, 1e9, 0.0);
  const Vector3d& from = *rc::gen::inRange(0, 3) > 0 ? pose.position : eye.position;
  shot.plane = distance == 0
                   ? Eigen::Vector4d(0, 0, 0, 1)
                   : testing::random_plane(from, distance, ahead + between(0, 0.7) * direction());
  return shot;
}

/// The position at which a ray crosses the camera plane, in nodes, and a bound of its rounding in
/// double.
struct Crossing {
  Real column, row;
  double bound = 0;
};

/// Returns the crossing by intersection; nullopt for a ray along the plane, where rounding
/// determines it.
std::optional<Crossing> exact_crossing(const Slab& slab, const VirtualCamera& view, double x,
                                       double y) {
  const Eigen::Matrix3d& r = slab.pose.world_from_camera_rotation;
  const ExactVector ray = exact_ray(view, x, y);
  const ExactVector eye = exact(view.pose.position) - exact(slab.pose.position);
  const Real along = dot(exact(r.col(2)), ray);
  const double length = static_cast<double>(norm(ray));
  const double slope = std::abs(static_cast<double>(along)) / length;
  const double terms = ray_term_magnitude(view, x, y) / length;
  if (slope < 1e-9 * terms) return std::nullopt;
  const ExactVector hit = eye - dot(exact(r.col(2)), eye) / along * ray;
  const auto nodes = [&](Eigen::Index axis, double spacing) {
    return spacing > 0 ? Real(dot(exact(r.col(axis)), hit) / spacing) : Real(0);
  };
  // The eye's distance at the ray's angle, with as many roundings as the ray has terms.
  const double least_spacing = slab.nodes() == 1
                                   ? 1
                                   : std::min(slab.columns > 1 ? slab.column_spacing : 1e300,
                                              slab.rows > 1 ? slab.row_spacing : 1e300);
  const double away = static_cast<double>(norm(eye)) / least_spacing;
  return Crossing{nodes(0, slab.column_spacing), -nodes(1, slab.row_spacing),
                  16 * kEpsilon * terms * (away + slab.columns + slab.rows) / slope};
}

/// Returns by how many nodes a crossing is within the grid; negative outside.
double to_edge(const Slab& slab, const Crossing& crossing) {
  const auto within = [](const Real& place, int count) {
    return count == 1 ? 1e300 : static_cast<double>(std::min(place, Real(Real(count - 1) - place)));
  };
  return std::min(within(crossing.column, slab.columns), within(crossing.row, slab.rows));
}

/// Returns the position at which a node sees a ray's point on the focal plane; nullopt where it
/// does not.
std::optional<std::array<Real, 2>> exact_uv(const Shot& shot, int column, int row, double x,
                                            double y) {
  const Slab& slab = shot.slab;
  ExactVector towards = exact_ray(shot.view, x, y);
  if (!shot.plane.head<3>().isZero(0)) {
    const auto depth = testing::exact_depth(shot.plane, shot.view.pose.position, towards);
    if (!depth || *depth <= 0) return std::nullopt;
    const Eigen::Matrix3d& r = slab.pose.world_from_camera_rotation;
    const ExactVector node =
        exact(slab.pose.position) + (Real(column * Real(slab.column_spacing)) * exact(r.col(0)) -
                                     Real(row * Real(slab.row_spacing)) * exact(r.col(1)));
    towards = (exact(shot.view.pose.position) + *depth * towards) - node;
  }
  return testing::exact_projection(slab.image, slab.pose, towards);
}

/// Returns the samples from a position in a node's image to its border; negative outside.
Real to_border(const Slab& slab, const std::array<Real, 2>& uv) {
  return std::min({uv[0], Real(slab.width - uv[0]), uv[1], Real(slab.height - uv[1])});
}

double at(const SlabRun::LinearFunction& f, double x, double y) {
  return f[0] * x + (f[1] * y + f[2]);
}

/// Returns a bound of the rounding in double of the position at which a node sees the point,
/// pixels. The vector from the node to the point is a sum of two: the ray times the eye's distance
/// from the plane, and the vector from node to eye. The node's position is rounded, too.
double uv_bound(const Shot& shot, const PlaneProjection& projection, double ahead, double x,
                double y) {
  const Slab& slab = shot.slab;
  const double terms = ray_term_magnitude(shot.view, x, y);
  const double extent = slab.columns * slab.column_spacing + slab.rows * slab.row_spacing;
  const double away = (shot.view.pose.position - slab.pose.position).norm() + extent;
  const double slope_terms =
      projection.slope().cwiseAbs().dot(Vector3d(std::abs(x), std::abs(y), 1));
  const double node_rounding = kEpsilon * (slab.pose.position.norm() + extent) *
                               std::abs(projection.slope().dot(Vector3d(x, y, 1)));
  const double off_axis = slab.width / slab.image.fx;
  return slab.image.fx * (1 + off_axis) *
         (16 * kEpsilon * (projection.distance() * terms + away * slope_terms) + node_rounding) /
         ahead;
}

TEST(SlabExtremes, RaysCrossBothPlanesWhere50DigitsDo) {
  WorstError st("slab: crossing, nodes", 1e-3), uv("slab: position, px", 1e-3);
  EXPECT_TRUE(rc::check("any slab, eye, focal plane and ray", [&] {
    const Shot shot = some_shot();
    const Slab& slab = shot.slab;
    const SlabRays rays(shot.view, slab);
    const auto truth = exact_crossing(slab, shot.view, shot.x, shot.y);
    const bool contains_ray = rays.contains_ray(shot.x, shot.y);
    if (slab.nodes() == 1) RC_ASSERT(contains_ray);
    if (truth && !contains_ray) RC_ASSERT(to_edge(slab, *truth) <= truth->bound);
    if (truth && contains_ray) RC_ASSERT(to_edge(slab, *truth) >= -(truth->bound + 2 * kEdge));
    if (!contains_ray) return;
    const SlabRays::Crossing crossing = rays.crossing(shot.x, shot.y);
    RC_ASSERT(crossing.column >= 0 && crossing.column <= slab.columns - 1);
    RC_ASSERT(crossing.row >= 0 && crossing.row <= slab.rows - 1);
    if (truth) {
      const double bound = truth->bound + (to_edge(slab, *truth) < truth->bound ? 2 * kEdge : 0);
      if (slab.columns > 1) st.expect(off(crossing.column, truth->column), bound);
      if (slab.rows > 1) st.expect(off(crossing.row, truth->row), bound);
    }
    const PlaneProjection projection(shot.view, shot.plane);
    const SlabRays::Run part{
        0, 1, std::min(static_cast<int>(crossing.column), std::max(0, slab.columns - 2)),
        std::min(static_cast<int>(crossing.row), std::max(0, slab.rows - 2))};
    const SlabRun run = SlabRuns(slab, rays, projection).run(part, 0);
    const double ahead = at(run.ahead, shot.x, shot.y);
    for (int i = 0; i < 4 && projection.depth(shot.x, shot.y) > 0; ++i) {
      const int column = i % 2, row = i / 2;
      if (column >= slab.columns || row >= slab.rows) continue;
      const auto seen = exact_uv(shot, part.column + column, part.row + row, shot.x, shot.y);
      if (!seen || to_border(slab, *seen) < 0) continue;
      RC_ASSERT(ahead > 0);
      const double bound = uv_bound(shot, projection, ahead, shot.x, shot.y);
      uv.expect(off(at(run.u[column], shot.x, shot.y) / ahead, (*seen)[0]), bound);
      uv.expect(off(at(run.v[row], shot.x, shot.y) / ahead, (*seen)[1]), bound);
    }
  }));
}

/// Returns the largest magnitude of a function along a run.
double most_along(const SlabRun& run, const SlabRun::LinearFunction& f) {
  const double y = run.y + 0.5;
  return std::max(std::abs(at(f, run.begin + 0.5, y)), std::abs(at(f, run.end - 0.5, y)));
}

/// Returns the part of the view's row that the kernel processes together with the pixel; nullopt
/// where no run contains the pixel.
std::optional<SlabRun> run_around(const Shot& shot, const SlabRays& rays,
                                  const PlaneProjection& projection, int x, int y) {
  std::vector<SlabRays::Run> runs;
  rays.runs_of_row(y, shot.view.width, runs);
  for (const SlabRays::Run& part : runs) {
    if (x < part.begin || x >= part.end) continue;
    SlabRays::Run chunk = part;
    chunk.begin += (x - part.begin) / kChunk * kChunk;
    chunk.end = std::min(chunk.begin + kChunk, part.end);
    return SlabRuns(shot.slab, rays, projection).run(chunk, y);
  }
  return std::nullopt;
}

TEST(SlabExtremes, KernelsInterpolateAs50DigitsDo) {
  const testing::SlabKernelProbe probe;
  testing::for_each_simd_target(slab_kernel_target, [&] {
    const std::string target = slab_kernel_target();
    WorstError weight(target + ": weight of a node", 1e-3), position(target + ": position, px", 1),
        depth(target + ": depth, relative", 1e-3), sum_of_weights(target + ": sum of weights");
    EXPECT_TRUE(rc::check("any slab, eye, focal plane and ray", [&] {
      const Shot shot = some_shot();
      const Slab& slab = shot.slab;
      const int x =
          std::clamp(static_cast<int>(std::clamp(shot.x, 0.0, 1e5)), 0, shot.view.width - 1);
      const int y =
          std::clamp(static_cast<int>(std::clamp(shot.y, 0.0, 1e5)), 0, shot.view.height - 1);
      const double centre_x = x + 0.5, centre_y = y + 0.5;
      const SlabRays rays(shot.view, slab);
      const PlaneProjection projection(shot.view, shot.plane);
      const auto truth = exact_crossing(slab, shot.view, centre_x, centre_y);
      const auto run = run_around(shot, rays, projection, x, y);
      RC_ASSERT(run.has_value() == rays.contains_ray(centre_x, centre_y));
      if (!run) return;

      const std::array<double, 4> weights = probe.weights(*run, x);
      for (const double part : weights)
        RC_ASSERT(part >= -4 * kFloatEpsilon && part <= 1 + 4 * kFloatEpsilon);
      sum_of_weights.expect(weights[0] + weights[1] + weights[2] + weights[3] - 1,
                            8 * kFloatEpsilon);
      // The cell is that of the run; the position of the crossing within it is the exact one.
      const SlabRays::Crossing crossing = rays.crossing(centre_x, centre_y);
      const double across = at(run->across, centre_x, centre_y);
      const auto cell = [&](double place, const SlabRun::LinearFunction& into, int count) {
        return count == 1
                   ? 0
                   : static_cast<int>(std::round(place - at(into, centre_x, centre_y) / across));
      };
      const int left = cell(crossing.column, run->column, slab.columns);
      const int upper = cell(crossing.row, run->row, slab.rows);
      if (truth) {
        // Floats step from the chunk's first pixel on; their rounding is relative to the largest
        // value.
        const double steepness = most_along(*run, run->across) / std::abs(across);
        const double bound = 8 * kFloatEpsilon * (1 + steepness) + truth->bound + 2 * kEdge;
        const auto share = [](const Real& place, int first, int count) -> Real {
          if (count == 1) return 0;
          return std::clamp(Real(place - first), Real(0), Real(1));
        };
        const Real right = share(truth->column, left, slab.columns);
        const Real lower = share(truth->row, upper, slab.rows);
        const std::array<Real, 4> expected{(1 - right) * (1 - lower), right * (1 - lower),
                                           (1 - right) * lower, right * lower};
        for (std::size_t i = 0; i < 4; ++i) weight.expect(off(weights[i], expected[i]), 2 * bound);
      }

      if (!(projection.depth(centre_x, centre_y) > 0)) return;
      for (std::size_t i = 0; i < 4; ++i) {
        const int column = left + static_cast<int>(i % 2), row = upper + static_cast<int>(i / 2);
        if (column >= slab.columns || row >= slab.rows) continue;
        const auto seen = exact_uv(shot, column, row, centre_x, centre_y);
        if (!seen || to_border(slab, *seen) < 2) continue;  // within the fade at the border
        const double ahead = at(run->ahead, centre_x, centre_y);
        const double steepness = most_along(*run, run->ahead) / ahead;
        const double reach =
            std::max(most_along(*run, run->u[i % 2]), most_along(*run, run->v[i / 2])) / ahead;
        const double bound = 4 * kFloatEpsilon * (1024 + reach + slab.width * steepness) +
                             uv_bound(shot, projection, ahead, centre_x, centre_y);
        const auto found = probe.seen(*run, i, x);
        if (found.alpha == 0) {
          RC_ASSERT(bound > 1);
          continue;
        }
        position.expect(std::max(off(found.u, (*seen)[0]), off(found.v, (*seen)[1])), bound);
        if (projection.at_infinity()) continue;
        const Real truly = *testing::exact_depth(shot.plane, shot.view.pose.position,
                                                 exact_ray(shot.view, centre_x, centre_y));
        const double slope = std::abs(projection.slope().dot(Vector3d(centre_x, centre_y, 1)));
        depth.expect(static_cast<double>(abs(Real(found.z) / truly - 1)),
                     4 * kFloatEpsilon * (1 + most_along(*run, run->slope) / slope) +
                         64 * kEpsilon * ray_term_magnitude(shot.view, centre_x, centre_y) / slope);
      }
    }));
  });
}

}  // namespace
}  // namespace raystage::render
