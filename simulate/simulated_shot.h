// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "schemas/shot_document.h"
#include "schemas/views_document.h"
#include "simulate/exposure_schedule.h"
#include "simulate/simulation_settings.h"

namespace raystage {

/// A camera move within the array's range of motion (thesis 5.2): across, up and down, forth and
/// back, with a little pan and zoom. As a shot of the take it lies in, and as the views on its way
/// whose truth is rendered: each at a whole frame of the shot that is also a key of its camera.
struct SimulatedShot {
  ShotDocument shot;
  ViewsDocument views;
};

/// Times follow the timeline that `raystage sync` builds of the take by default. `focus`: distance
/// of the shot's focal plane in front of the array, metres.
SimulatedShot make_simulated_shot(const SimulationSettings& settings,
                                  const ExposureSchedule& schedule, double focus);

}  // namespace raystage
