// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "rig/line_time_check.h"
#include "store/timeline.h"

namespace raystage::render {

/// Throws Error (bad input) if rows of a take cannot be moved to exact times
/// (store/exact_frames.h), because its rig states a line time that no frame of it can have: see
/// rig/line_time_check.h.
inline void require_plausible_line_times(const store::Take& take, const store::Timeline& timeline) {
  if (timeline.ticks.size() < 2) return;  // a still light field has no rate
  std::vector<double> periods_ns;
  for (const store::CameraClock& clock : timeline.clocks) periods_ns.push_back(clock.period_ns);
  // Ticks may be at another rate than the frames.
  const double nominal = take.document().nominal_fps;
  if (const auto error =
          rig::line_time_error(take.rig(), periods_ns, nominal > 0 ? nominal : timeline.fps,
                               (take.folder() / "rig.json").string())) {
    throw Error(*error);
  }
}

}  // namespace raystage::render
