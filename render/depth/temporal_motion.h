// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>

#include "base/image.h"
#include "render/depth/inverse_depth_map.h"
#include "store/processing/motion/optical_flow.h"

namespace raystage::render {

/// A camera's picture (luma, 8-bit codes; 0: unknown) and inverse depths (1/m).
struct PictureWithDepths {
  store::Luma luma;
  InverseDepthMap depths;
};

/// Returns the picture and depths of another time, moved to where `now` shows the same: along the
/// optical flow, where that is at least kLeastFlow pixels. Luma is bilinear, depths are those of
/// the nearest pixel. What leaves the picture is unknown.
PictureWithDepths moved_along_flow(const store::Luma& now, PictureWithDepths then,
                                   store::OpticalFlowEstimator& flow);
inline constexpr float kLeastFlow = 0.5F;

}  // namespace raystage::render
