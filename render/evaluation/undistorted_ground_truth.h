// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <vector>

#include "render/common/view.h"
#include "rig/camera_model.h"
#include "store/jpeg/rgb_image.h"

namespace raystage {

/// What is true of a view.
struct GroundTruth {
  RgbImage image;
  std::vector<std::uint8_t> known;  ///< 1 per pixel of which it says something; empty: of all
};

/// A camera's `frame` as the camera without distortion at its place sees it (`pinhole`: its
/// undistorted()), interpolated cubically (Catmull and Rom) between codes. Unknown is what lies
/// outside the frame.
GroundTruth undistorted_ground_truth(const RgbImage& frame, const CameraModel& model,
                                     const VirtualCamera& pinhole);

}  // namespace raystage
