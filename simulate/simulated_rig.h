// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "rig/pose.h"
#include "schemas/rig_document.h"
#include "simulate/simulation_options.h"

namespace raystage::simulate {

/// The simulated array as designed (`nominal`) and as built (`truth`). Line times of a given rig
/// are in both; SimulationOptions::line_time_us replaces them in the truth, and the design then has
/// none. Cameras are named "rRcC": row 0 is the top row, column 0 is on the left as seen from
/// behind.
struct SimulatedRig {
  schemas::RigDocument nominal, truth;
};

/// Returns the pose of the array's centre in the world; without rotation the array looks along -z.
rig::Pose simulated_rig_pose(const SimulationOptions& options);

/// Returns an array whose deviations are functions of the settings and their seed.
SimulatedRig make_simulated_rig(const SimulationOptions& options);

}  // namespace raystage::simulate
