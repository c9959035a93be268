// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <cmath>
#include <utility>

#include "render/common/blending_field.h"
#include "render/renderer.h"
#include "testing/render/test_depth.h"

/// Scenes for tests of plane_sweep, and measures of its errors.
namespace raystage::testing {

class PlaneSweep : public ::testing::Test {
 protected:
  static SyntheticTake slanted(int rows, int columns, const schemas::Distortion& distortion = {}) {
    SyntheticTake take;
    take.cameras = camera_grid(rows, columns, 0.1, 96, 72, distortion);
    take.depth_range = schemas::DepthRange{2.5, 7};
    take.scene = slanted_scene;
    return take;
  }
  static SyntheticTake step_edge() {
    SyntheticTake take = slanted(3, 3);
    take.scene = step_scene;
    return take;
  }
  store::Take write(const SyntheticTake& settings) {
    write_synthetic_take(settings, folder_.path() / "take");
    return store::Take(folder_.path() / "take");
  }
  static render::RenderedView render(const store::Take& take, const render::VirtualCamera& view,
                                     schemas::OptionValues options = {},
                                     const render::RendererOptions& settings = {}, int frame = 0) {
    const store::FrameSelection frames =
        store::select_frames(take, frame * kNanosecondsPerSecond / 15, 30'000'000);
    return render::LightFieldRenderer(take, settings)
        .render(view, frames, {"plane_sweep", {0, 0, 0, 1}, std::move(options)});
  }
  TestFolder folder_;
};

struct SlantedErrors {
  double disparity = 0;  ///< mean, pixels between neighbouring cameras
  double colour = 0;     ///< mean, linear light
};

/// Measures a view of slanted() without its border.
inline SlantedErrors measure_slanted_errors(const render::RenderedView& image,
                                            const render::VirtualCamera& view) {
  constexpr double kPixelMetres = 80 * 0.1;  // focal length times the cameras' spacing
  const render::ViewRays rays(view);
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
