// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "ingest/simulated/settings.h"
#include "rig/pose.h"
#include "schemas/rig_document.h"

namespace raystage {

/// The simulated array: as it was designed, and as it was built. Cameras are named "rRcC", row 0 on
/// top, column 0 on the left as seen from behind.
struct SimulatedArray {
  RigDocument nominal, truth;
};

/// From the array as if it looked down -z from the origin.
Pose array_pose(const SimulationSettings& settings);

SimulatedArray make_array(const SimulationSettings& settings);

}  // namespace raystage
