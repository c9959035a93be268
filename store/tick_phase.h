// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "base/time.h"

namespace raystage::store {

/// Returns the frames per second of cameras that run at one rate, or 0 if no camera has two frames.
/// `times`: of the frames, per camera, increasing. The median interval counts as one frame; every
/// interval of a few frames then counts with its number of frames. So neither dropped frames nor
/// time stamps in whole milliseconds bias the rate.
double detect_frame_rate(const std::vector<std::vector<Nanoseconds>>& times);

/// Returns the tick phase, in [0, period) ns, that fits the frames best. It minimises the mean
/// squared difference, with few frames near the border between two ticks: jitter could move them to
/// the adjacent tick. Phases of free-running cameras cover the whole period; the border then goes
/// where the fewest frames are.
double best_tick_phase(const std::vector<std::vector<Nanoseconds>>& times, double period);

}  // namespace raystage::store
