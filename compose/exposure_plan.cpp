// SPDX-License-Identifier: Apache-2.0
// Chooses the times at which a frame with motion blur is rendered. The motion of the camera is that
// of points on a grid of the picture, at the nearest depth of the takes and meshes and at infinity;
// that of meshes is that of their bounding spheres. Light fields whose time goes on, and nodes of
// meshes, may move in any way: where their pictures do not differ, rendering ends early. Cost:
// microseconds.
#include "compose/exposure_plan.h"

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>

#include "compose/layers/motion_vectors.h"

namespace raystage::compose {
namespace {

using Eigen::Vector3d;
using Eigen::Vector4d;

constexpr int kIntervalsOfUnseenMotion = 8;
constexpr double kNearestDepth = 0.1;  // metres
constexpr double kStill = 0.02;        // pixels: less is not visible

double length_of(const std::array<float, 4>& motion) {
  return std::hypot(motion[0], motion[1]) + std::hypot(motion[2], motion[3]);
}

/// The views of a frame's middle and ends.
struct ExposureViews {
  render::VirtualCamera middle;
  AdjacentViews ends;

  /// Returns how far a point moves in the picture, pixels.
  double motion(const MovingPoint& point) const {
    if (!middle.is_equirectangular) return length_of(motion_vector(middle, ends, point));
    const auto direction = [&](const render::VirtualCamera& view, const Vector4d& at) -> Vector3d {
      return (view.pose.world_from_camera_rotation.transpose() *
              (at.head<3>() - at.w() * view.pose.position))
          .normalized();
    };
    const Vector3d first = direction(ends.before, point.before),
                   last = direction(ends.after, point.after);
    return std::atan2(first.cross(last).norm(), first.dot(last)) / render::pixel_angle(middle);
  }
};

/// Returns the largest motion of points that stand still, pixels.
double camera_motion(const ExposureViews& views, double nearest) {
  constexpr int kGrid = 4;
  double most = 0;
  for (int i = 0; i <= kGrid; ++i) {
    for (int j = 0; j <= kGrid; ++j) {
      const double x = views.middle.width * static_cast<double>(i) / kGrid,
                   y = views.middle.height * static_cast<double>(j) / kGrid;
      const render::WorldRay ray = render::pixel_ray(views.middle, x, y);
      Vector4d near, far;
      near << ray.origin + nearest * ray.direction.normalized(), 1;
      far << ray.direction, 0;
      for (const Vector4d& point : {near, far}) {
        most = std::max(most, views.motion({point, point, point}));
      }
    }
  }
  return most;
}

/// Returns the largest motion of a mesh's bounding sphere, pixels.
double mesh_motion(const ExposureViews& views, const GeometryLayer& mesh, int frame, double half) {
  const auto [centre, radius] = mesh.bounds_at(frame);
  double most = 0;
  for (const ObjectMotion& moved : mesh.motion_at(frame)) {
    for (int side = 0; side <= 6; ++side) {
      Vector3d point = centre;
      if (side < 6) point[side / 2] += side % 2 == 0 ? radius : -radius;
      const auto at = [&](const Eigen::Affine3d& there) {
        Vector4d result;
        result << point + half * (there * point - point), 1;
        return result;
      };
      most =
          std::max(most, views.motion({at(moved.before_from_now), at(Eigen::Affine3d::Identity()),
                                       at(moved.after_from_now)}));
    }
  }
  return most;
}

}  // namespace

double exposure_end(const ShotPlan& plan, int frame) {
  if (plan.shot().output.motion_samples <= 1) return 0;
  const double shutter_deg = plan.shot_camera().state(frame).shutter_deg.value_or(0);
  return std::round(kOffsetsPerFrame * shutter_deg / 720) / kOffsetsPerFrame;
}

std::vector<double> exposure_offsets(const ShotPlan& plan, int frame) {
  const double half = exposure_end(plan, frame);
  const auto half_steps = static_cast<int>(std::lround(half * kOffsetsPerFrame));
  const int most_intervals = static_cast<int>(std::bit_floor(
      static_cast<unsigned>(std::min(plan.shot().output.motion_samples - 1, 2 * half_steps))));
  if (half_steps < 1 || most_intervals < 2) return {};
  double nearest = std::numeric_limits<double>::infinity(), moved = 0;
  bool moves_unseen = false;
  for (const LightFieldLayer* layer : plan.light_fields()) {
    if (!plan.is_needed(layer->index(), frame)) continue;
    if (const auto range = layer->depth_range()) nearest = std::min(nearest, range->near);
    moves_unseen = moves_unseen || layer->moves_between(frame - half, frame) ||
                   layer->moves_between(frame, frame + half);
  }
  for (const Eye eye : plan.eyes()) {
    const ExposureViews views{plan.camera(frame, eye),
                              {plan.camera(frame - half, eye), plan.camera(frame + half, eye)}};
    for (std::size_t i = 0; i < plan.layers(); ++i) {
      const GeometryLayer* mesh = plan.geometry(i);
      if (mesh == nullptr || !plan.is_visible(i, frame)) continue;
      const auto [centre, radius] = mesh->bounds_at(frame);
      nearest = std::min(nearest, (centre - views.middle.pose.position).norm() - radius);
      moved = std::max(moved, mesh_motion(views, *mesh, frame, half));
      moves_unseen = moves_unseen || mesh->key_frames().has_value();
    }
    if (!std::isfinite(nearest)) nearest = 1;
    moved = std::max(moved, camera_motion(views, std::max(kNearestDepth, nearest)));
  }
  if (moved < kStill && !moves_unseen) return {};
  const double wanted = std::max(std::min(moved, static_cast<double>(most_intervals)),
                                 moves_unseen ? kIntervalsOfUnseenMotion : 2.0);
  const int intervals = std::min(
      most_intervals, static_cast<int>(std::bit_ceil(static_cast<unsigned>(std::ceil(wanted)))));
  std::vector<double> offsets;
  for (int i = 0; i <= intervals; ++i) {
    const double part = 2.0 * i / intervals - 1;
    offsets.push_back(std::round(part * half_steps) / kOffsetsPerFrame);
  }
  return offsets;
}

}  // namespace raystage::compose
