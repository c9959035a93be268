// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "compose/shot_plan.h"

namespace raystage::compose {

/// Returns the offsets from a frame, in frames, at which its exposure is sampled: 2^n + 1, from the
/// time that the shutter opens to the time that it closes, the frame in the middle. Neighbours are
/// so close that the camera and meshes move by at most a pixel between them, but for the shot's
/// output.motion_samples; there are at least 9 if a light field or a node of a mesh may move.
/// Empty: the camera states no shutter angle, or nothing moves. Multiples of 1 / kOffsetsPerFrame.
std::vector<double> exposure_offsets(const ShotPlan& plan, int frame);

/// Returns the offset from a frame, in frames, at which the shutter closes; 0: there is no motion
/// blur. Depends on the camera alone, unlike exposure_offsets().
double exposure_end(const ShotPlan& plan, int frame);

}  // namespace raystage::compose
