// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
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
};

/// Returns a camera's frame resampled without lens distortion (`pinhole`: its undistorted()), by
/// cubic interpolation of codes (Catmull-Rom). Pixels outside the frame are unknown.
GroundTruth undistorted_ground_truth(const store::RgbImage& frame, const rig::CameraModel& model,
                                     const render::VirtualCamera& pinhole);

}  // namespace raystage::evaluation
