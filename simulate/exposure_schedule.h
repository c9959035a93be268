// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "base/time.h"
#include "simulate/simulation_options.h"
#include "store/archive.h"

namespace raystage::simulate {

/// The exposure times of each camera, their time stamps by the clock of its node, and the status of
/// each frame. Times are in nanoseconds since the take's epoch.
struct ExposureSchedule {
  struct Frame {
    Nanoseconds true_time = 0;     ///< middle of the exposure, of the picture's middle row
    Nanoseconds stamped_time = 0;  ///< by the clock of the camera's node
    store::FrameStatus status = store::FrameStatus::kStored;
  };
  struct Camera {
    int node = 0;
    Nanoseconds phase = 0;  ///< true time of frame 0 without jitter
    double period_ns = 0;   ///< true time between its exposures
    std::vector<Frame> frames;
  };
  std::vector<Nanoseconds> clock_offset;  ///< per node: stamped time - true time
  std::vector<Camera> cameras;
};

ExposureSchedule make_exposure_schedule(const SimulationOptions& options);

}  // namespace raystage::simulate
