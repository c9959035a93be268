// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "base/time.h"

namespace raystage {

/// Frames per second of cameras that run at one rate, from the times of their frames (per camera,
/// increasing); 0 where no camera has two frames. The median interval is taken for one frame; then
/// every interval of a few frames counts with its number of frames, so that neither dropped frames
/// nor time stamps in whole milliseconds shift the rate.
double detect_rate(const std::vector<std::vector<Nanoseconds>>& times);

/// Time in [0, period), in nanoseconds, of a tick such that the frames lie best about the ticks:
/// least mean squared difference, and few frames where jitter could throw them to the tick before
/// or behind (free-running cameras lie all around the period; the border between two ticks then
/// goes where the fewest are).
double best_tick_phase(const std::vector<std::vector<Nanoseconds>>& times, double period);

}  // namespace raystage
