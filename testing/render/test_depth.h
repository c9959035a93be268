// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Core>
#include <array>
#include <cmath>
#include <filesystem>
#include <utility>
#include <vector>

#include "render/renderer.h"
#include "store/timeline.h"
#include "testing/render/synthetic_take.h"
#include "testing/render/test_poses.h"
#include "testing/render/test_views.h"
#include "testing/test_folder.h"

namespace raystage::testing {

/// Returns a finer texture than the painted plane's, so that depth can be estimated.
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

/// Returns whether a ray hits the wall, which is everything left of x = 0.1 on the front plane;
/// behind it is the back plane.
inline bool hits_wall(const Eigen::Vector3d& from, const Eigen::Vector3d& direction) {
  return (from + kFront.distance(from, direction) * direction).x() < 0.1;
}
inline std::array<double, 3> step_scene(const Eigen::Vector3d& from,
                                        const Eigen::Vector3d& direction) {
  const Plane& plane = hits_wall(from, direction) ? kFront : kBack;
  const Eigen::Vector3d hit = from + plane.distance(from, direction) * direction;
  return texture(hit.x(), hit.y() + plane.c);
}
inline std::array<double, 3> slanted_scene(const Eigen::Vector3d& from,
                                           const Eigen::Vector3d& direction) {
  const Eigen::Vector3d hit = from + kSlanted.distance(from, direction) * direction;
  return texture(hit.x(), hit.y());
}

/// Writes takes of these scenes and renders them by method depth.
class DepthTest : public ::testing::Test {
 protected:
  static SyntheticTake slanted(int rows, int columns, const schemas::Distortion& distortion = {}) {
    SyntheticTake take;
    take.cameras = camera_grid(rows, columns, 0.1, 96, 72, distortion);
    take.depth_range = schemas::DepthRange{2.5, 7};
    take.scene = slanted_scene;
    return take;
  }
  static SyntheticTake step_edge(int rows, int columns) {
    SyntheticTake take = slanted(rows, columns);
    take.scene = step_scene;
    return take;
  }
  std::filesystem::path take_folder() const { return folder_.path() / "take"; }
  store::Take write(const SyntheticTake& settings) {
    write_synthetic_take(settings, take_folder());
    return store::Take(take_folder());
  }
  static render::RenderedView render(const store::Take& take, const render::VirtualCamera& view,
                                     schemas::OptionValues options = {},
                                     const render::RendererOptions& settings = {}, int frame = 0) {
    return render_reconstruction(take, view, {"depth", {0, 0, 0, 1}, std::move(options)}, settings,
                                 frame);
  }
  /// Returns the view as a shot that shows no other.
  static render::RenderedView render_shown(const store::Take& take,
                                           const render::VirtualCamera& view,
                                           schemas::OptionValues options,
                                           const render::RendererOptions& settings = {}) {
    render::ReconstructionOptions how{"depth", {0, 0, 0, 1}, std::move(options)};
    how.shown_views = {view};
    return render_reconstruction(take, view, how, settings, 0);
  }
  static render::RenderedView render_reconstruction(const store::Take& take,
                                                    const render::VirtualCamera& view,
                                                    const render::ReconstructionOptions& how,
                                                    const render::RendererOptions& settings,
                                                    int frame) {
    const store::FrameSelection frames =
        store::select_frames(take, frame * kNanosecondsPerSecond / 15, 30'000'000);
    return render::LightFieldRenderer(take, settings).render(view, frames, how);
  }
  std::vector<std::filesystem::path> stored_depth_files() const {
    std::vector<std::filesystem::path> files;
    std::error_code none;
    for (const auto& entry :
         std::filesystem::recursive_directory_iterator(take_folder() / "depth", none)) {
      if (entry.is_regular_file()) files.push_back(entry.path());
    }
    return files;
  }
  TestFolder folder_;
};

inline render::VirtualCamera default_view() {
  return render::virtual_camera_with_fov(90, 64, 40 * kDegree, make_pose({0.02, 0.013, 0.03}, 2));
}

/// Expects equal views: both results blend at the same depths, so they differ only by float
/// rounding.
inline void expect_equal(const render::RenderedView& fast, const render::RenderedView& slow) {
  for (std::size_t i = 0; i < fast.coverage.size(); ++i) {
    ASSERT_NEAR(fast.coverage[i], slow.coverage[i], 2e-3) << "pixel " << i;
    for (std::size_t c = 0; c < 4; ++c) {
      ASSERT_NEAR(fast.rgba[4 * i + c], slow.rgba[4 * i + c], 3e-3) << "pixel " << i;
    }
    if (std::isfinite(slow.z[i])) {
      ASSERT_NEAR(fast.z[i], slow.z[i], 1e-4 * static_cast<double>(slow.z[i]));
    }
  }
}

}  // namespace raystage::testing
