// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>

#include "store/processing/sync/resync.h"

namespace raystage::store {

/// Returns runs of slots without a frame between the camera's first and last frame. Times are on
/// the corrected clock; `clock`: of the camera; `base`: the time that the fit's times count from.
std::vector<LostRun> find_lost_runs(const CameraTimestamps& camera, const ClockFit& fit,
                                    const CameraClock& clock, Nanoseconds base);

/// Returns the frames lost in a gap between the corrected times of two frames; count 0: none. The
/// caller sets `first`.
LostRun find_lost_run_between(const CameraTimestamps& camera, const CameraClock& clock,
                              Nanoseconds last, Nanoseconds next);

/// Returns the end of the start-up. Before it, from the beginning on, at least a tenth of the
/// frames are lost. After it the rate of losses is at most a third of that. The maximum of the
/// likelihood determines the time. Cameras that start after `range.begin` count as losing frames
/// until they start. `period`: of the ticks, ns. Returns nullopt without such a time, and for more
/// ticks or lost frames than a recording can have.
std::optional<Nanoseconds> find_start_up_end(std::span<const CameraSync> cameras,
                                             const std::vector<CameraClock>& clocks,
                                             const std::vector<std::vector<Nanoseconds>>& times,
                                             const TimeRange& range, double period);

}  // namespace raystage::store
