// SPDX-License-Identifier: Apache-2.0
#include "compose/layers/motion_vectors.h"

#include <algorithm>
#include <cmath>
#include <optional>

#include "base/parallel.h"

namespace raystage::compose {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using Eigen::Vector4d;

constexpr int kRowsPerTask = 16;

/// Returns the pixel of a point; none behind the camera.
std::optional<Vector2d> pixel_of(const render::VirtualCamera& view, const Vector4d& point) {
  const Vector3d in_camera = view.pose.world_from_camera_rotation.transpose() *
                             (point.head<3>() - point.w() * view.pose.position);
  if (!(in_camera.z() < 0)) return std::nullopt;
  const schemas::Intrinsics& k = view.intrinsics;
  const Vector2d pixel(k.cx + k.fx * in_camera.x() / -in_camera.z(),
                       k.cy - k.fy * in_camera.y() / -in_camera.z());
  // Points beside the camera move without end.
  constexpr double kFarthest = 1e6;
  if (!(pixel.cwiseAbs().maxCoeff() < kFarthest)) return std::nullopt;
  return pixel;
}

}  // namespace

std::array<float, 4> motion_vector(const render::VirtualCamera& view, const AdjacentViews& adjacent,
                                   const MovingPoint& point) {
  std::array<float, 4> motion{};
  const auto now = pixel_of(view, point.now);
  if (!now) return motion;
  const auto add = [&](const render::VirtualCamera& other, const Vector4d& there, std::size_t at,
                       double sign) {
    const auto pixel = pixel_of(other, there);
    if (!pixel) return;
    const Vector2d moved = sign * (*pixel - *now);
    motion[at] = static_cast<float>(moved.x());
    motion[at + 1] = static_cast<float>(-moved.y());  // pixels count downwards
  };
  add(adjacent.before, point.before, 0, 1);
  add(adjacent.after, point.after, 2, -1);
  return motion;
}

Aov empty_motion_aov(std::size_t pixels) {
  Aov aov{"motion", {"X", "Y", "Z", "W"}, false, 0, {}};
  aov.values.assign(4 * pixels, 0.0F);
  return aov;
}

void add_camera_motion(const render::VirtualCamera& view, const AdjacentViews& adjacent,
                       LayerImage& image) {
  Aov aov = empty_motion_aov(image.pixels());
  const int tasks = (image.height + kRowsPerTask - 1) / kRowsPerTask;
  parallel_for(0, tasks, [&](int task) {
    const int end = std::min(image.height, (task + 1) * kRowsPerTask);
    for (int y = task * kRowsPerTask; y < end; ++y) {
      for (int x = 0; x < image.width; ++x) {
        const std::size_t pixel = static_cast<std::size_t>(y) * image.width + x;
        if (!(image.rgba[4 * pixel + 3] > 0)) continue;
        const double z = image.z[pixel];
        Vector4d point;
        if (std::isfinite(z)) {
          point << render::point_at_depth(view, x + 0.5, y + 0.5, z), 1;
        } else {
          point << render::pixel_ray(view, x + 0.5, y + 0.5).direction, 0;
        }
        std::ranges::copy(motion_vector(view, adjacent, {point, point, point}),
                          aov.values.begin() + static_cast<std::ptrdiff_t>(4 * pixel));
      }
    }
  });
  image.aovs.push_back(std::move(aov));
}

}  // namespace raystage::compose
