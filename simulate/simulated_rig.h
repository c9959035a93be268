// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "rig/pose.h"
#include "schemas/rig_document.h"
#include "simulate/simulation_settings.h"

namespace raystage {

/// The simulated array: as it was designed, and as it was built. Cameras are named "rRcC", row 0 on
/// top, column 0 on the left as seen from behind.
struct SimulatedRig {
  RigDocument nominal, truth;
};

/// From the array as if it looked down -z from the origin.
Pose simulated_rig_pose(const SimulationSettings& settings);

SimulatedRig make_simulated_rig(const SimulationSettings& settings);

}  // namespace raystage
