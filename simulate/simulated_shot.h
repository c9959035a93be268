// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "schemas/shot_document.h"
#include "schemas/views_document.h"
#include "simulate/exposure_schedule.h"
#include "simulate/simulation_options.h"

namespace raystage::simulate {

/// A camera move within the array's range of motion (thesis 5.2) along all axes, with a small pan
/// and zoom. `shot` renders it from the take. `views` are the views with a ground-truth image, each
/// at a whole frame that is also a camera key of the shot. With a shutter angle the light field is
/// shown at exact times.
struct SimulatedShot {
  schemas::ShotDocument shot;
  schemas::ViewsDocument views;
  /// Of each view: at the times of which its picture is the mean, with its camera then.
  std::vector<std::vector<schemas::ViewsDocument::View>> exposures;
};

/// Makes the shot and its views. Times refer to the timeline that `raystage sync` builds by
/// default. `focus`: distance of the shot's focal plane from the array, metres.
SimulatedShot make_simulated_shot(const SimulationOptions& options,
                                  const ExposureSchedule& schedule, double focus);

}  // namespace raystage::simulate
