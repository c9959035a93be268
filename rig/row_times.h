// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cmath>

#include "base/time.h"

namespace raystage::rig {

/// Returns the time from a frame's time stamp to the exposure at height `y` of its picture, in the
/// unit of `line_time`: the time stamp marks the middle of the picture. `y`: pixels, 0 at the top
/// border, pixel centres at +0.5. `line_time`: from the exposure of a row to that of the row below;
/// negative: from the bottom up; 0: global shutter. The only definition of row times.
constexpr double row_time(double line_time, int height, double y) {
  return line_time * (y - height / 2.0);
}

/// Returns row_time() in nanoseconds for a line time in microseconds, as in rig.json.
inline Nanoseconds row_time_ns(double line_time_us, int height, double y) {
  return static_cast<Nanoseconds>(std::llround(1e3 * row_time(line_time_us, height, y)));
}

/// Returns a line time in fractions of the time between two frames, which is above 0.
constexpr double line_part(double line_time_us, Nanoseconds interval) {
  return 1e3 * line_time_us / static_cast<double>(interval);
}

/// Returns the read-out time of a frame in milliseconds: from the exposure of the first row to the
/// end of that of the last one, without the exposure time itself; at least 0.
inline double read_out_ms(double line_time_us, int height) {
  return 1e-3 * std::abs(line_time_us) * height;
}

}  // namespace raystage::rig
