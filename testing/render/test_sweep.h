// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <array>
#include <cmath>
#include <numbers>
#include <utility>

#include "render/common/blending_field.h"
#include "render/renderer.h"
#include "testing/render/synthetic_take.h"
#include "testing/render/test_poses.h"

/// Scenes that tests of plane_sweep look at, and how well they are seen.
namespace raystage::testing {

/// More texture than the painted plane has, so that depth shows.
inline std::array<double, 3> texture(double x, double y) {
  const auto rgb = painted_plane(1.5 * x, 1.5 * y);
  const auto fine = painted_plane(4 * x + 1, 4 * y);
  return {(rgb[0] + fine[1]) / 2, (rgb[1] + fine[2]) / 2, (rgb[2] + fine[0]) / 2};
}

/// The plane n.X = c.
struct Plane {
  Eigen::Vector3d normal;
  double c;
  double distance(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) const {
    return (c - normal.dot(from)) / normal.dot(direction);
  }
};
inline const Plane kSlanted{{0.35, 0.1, 1}, -4};
inline const Plane kBack{{0, 0, 1}, -5}, kFront{{0, 0, 1}, -2.5};

/// Everything nearer than x = 0.1 on the front plane is a wall; behind it the back plane.
inline bool hits_wall(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
  return (from + kFront.distance(from, direction) * direction).x() < 0.1;
}

class PlaneSweep : public ::testing::Test {
 protected:
  static SyntheticTake slanted(int rows, int columns, const Distortion& distortion = {}) {
    SyntheticTake take;
    take.cameras = camera_grid(rows, columns, 0.1, 96, 72, distortion);
    take.depth_range = DepthRange{2.5, 7};
    take.scene = [](const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
      const Eigen::Vector3d hit = from + kSlanted.distance(from, direction) * direction;
      return texture(hit.x(), hit.y());
    };
    return take;
  }
  static SyntheticTake step_edge() {
    SyntheticTake take = slanted(3, 3);
    take.scene = [](const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
      const Plane& plane = hits_wall(from, direction) ? kFront : kBack;
      const Eigen::Vector3d hit = from + plane.distance(from, direction) * direction;
      return texture(hit.x(), hit.y() + plane.c);
    };
    return take;
  }
  Take write(const SyntheticTake& settings) {
    write_synthetic_take(settings, folder_.path() / "take");
    return Take(folder_.path() / "take");
  }
  static RenderedView render(const Take& take, const VirtualCamera& view, OptionValues options = {},
                             const RendererSettings& settings = {}, int frame = 0) {
    const FrameSelection frames =
        select_frames(take, frame * kNanosecondsPerSecond / 15, 30'000'000);
    return LightFieldRenderer(take, settings)
        .render(view, frames, {"plane_sweep", {0, 0, 0, 1}, std::move(options)});
  }
  TestFolder folder_;
};

inline VirtualCamera default_view() {
  return virtual_camera_with_fov(90, 64, 40 * kDegree, make_pose({0.02, 0.013, 0.03}, 2));
}

struct SlantedErrors {
  double disparity = 0;  ///< mean, pixels between neighbouring cameras
  double colour = 0;     ///< mean, linear light
};

/// Of a view of slanted(), but for its border.
inline SlantedErrors measure_slanted_errors(const RenderedView& image, const VirtualCamera& view) {
  constexpr double kPixelMetres = 80 * 0.1;  // focal length times the cameras' spacing
  const ViewRays rays(view);
  SlantedErrors errors;
  int count = 0;
  for (int y = 8; y < view.height - 8; ++y) {
    for (int x = 8; x < view.width - 8; ++x) {
      const auto at = static_cast<std::size_t>(y * view.width + x);
      const Eigen::Vector3d ray = *rays.through(x + 0.5, y + 0.5);
      const double depth = kSlanted.distance(view.pose.position, ray);
      const Eigen::Vector3d hit = view.pose.position + depth * ray;
      const auto truth = texture(hit.x(), hit.y());
      errors.disparity += std::abs(1 / static_cast<double>(image.z[at]) - 1 / depth) * kPixelMetres;
      for (std::size_t c = 0; c < 3; ++c) {
        errors.colour += std::abs(static_cast<double>(image.rgba[4 * at + c]) - truth[c]) / 3;
      }
      ++count;
    }
  }
  return {errors.disparity / count, errors.colour / count};
}

}  // namespace raystage::testing
