// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "evaluation/truth_regions.h"
#include "render/common/view.h"
#include "rig/camera_model.h"
#include "store/jpeg/rgb_image.h"

namespace raystage::evaluation {

struct GroundTruth {
  store::RgbImage image;
  std::vector<std::uint8_t> known;  ///< 1 per known pixel; empty: all are known
  /// Planar depth of what each pixel's centre sees, metres, infinite for nothing; empty: unknown.
  std::vector<float> z = {};
  /// The surfaces of each pixel; empty: unknown.
  std::vector<TrueSurfaces> surfaces = {};
  /// Linear light of each pixel, R, G, B, white = 1, not clipped; empty: unknown.
  std::vector<float> light = {};
};

/// Returns a camera's frame resampled without lens distortion (`pinhole`: its undistorted()), by
/// cubic interpolation of codes (Catmull-Rom). Pixels outside the frame are unknown. `light`: of
/// the frame, as GroundTruth::light, or empty; it is interpolated bilinearly, which makes no light
/// brighter than its neighbours around highlights.
GroundTruth undistorted_ground_truth(const store::RgbImage& frame, const rig::CameraModel& model,
                                     const render::VirtualCamera& pinhole,
                                     std::span<const float> light = {});

}  // namespace raystage::evaluation
