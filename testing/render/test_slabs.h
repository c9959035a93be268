// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>

#include "render/renderer.h"
#include "testing/render/synthetic_take.h"
#include "testing/render/test_poses.h"
#include "testing/render/test_views.h"

namespace raystage::testing {

inline const Eigen::Vector4d kPaintedPlane(0, 0, 1, 4);

struct FastAndReference {
  render::RenderedView fast, reference;
};

struct RenderCase {
  Eigen::Vector4d plane = kPaintedPlane;
  schemas::OptionValues options = {};
  int frame = 0;
  store::BlendSpace space = store::BlendSpace::kPerceptual;
};

inline FastAndReference render_both(const store::Take& take, const render::VirtualCamera& view,
                                    const RenderCase& asked = {}) {
  const store::FrameSelection frames =
      store::select_frames(take, asked.frame * kNanosecondsPerSecond / 15, 30'000'000);
  render::RendererOptions settings;
  settings.blend_space = asked.space;
  const render::ReconstructionOptions how{"slabs", asked.plane, asked.options};
  FastAndReference pair;
  pair.fast = render::LightFieldRenderer(take, settings).render(view, frames, how);
  settings.reference = true;
  pair.reference = render::LightFieldRenderer(take, settings).render(view, frames, how);
  return pair;
}

inline void expect_equal(const FastAndReference& pair, double tolerance = 1e-3,
                         double alpha_tolerance = 1e-3) {
  double worst = 0;
  for (std::size_t i = 0; i < pair.fast.coverage.size(); ++i) {
    for (std::size_t c = 0; c < 3; ++c) {
      worst = std::max(worst, std::abs(static_cast<double>(pair.fast.rgba[i * 4 + c]) -
                                       static_cast<double>(pair.reference.rgba[i * 4 + c])));
    }
    ASSERT_NEAR(pair.fast.rgba[i * 4 + 3], pair.reference.rgba[i * 4 + 3], alpha_tolerance) << i;
    ASSERT_NEAR(pair.fast.coverage[i], pair.reference.coverage[i], alpha_tolerance) << i;
    if (std::isfinite(pair.fast.z[i]) && std::isfinite(pair.reference.z[i])) {
      ASSERT_NEAR(pair.fast.z[i] / pair.reference.z[i], 1, 1e-4) << "pixel " << i;
    }
  }
  EXPECT_LT(worst, tolerance);
}

}  // namespace raystage::testing
