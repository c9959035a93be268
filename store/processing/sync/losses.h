// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>

#include "store/processing/sync/resync.h"

namespace raystage {

/// Slots between the camera's first and last frame that have none, as runs. `offset` is the
/// camera's; times are on the corrected clock, `base` the time fit's times count from.
std::vector<LostRun> lost_runs(const CameraStamps& camera, const ClockFit& fit,
                               const CameraClock& clock, Nanoseconds base);

/// Frames lost over a gap between the corrected times of two frames; count 0: none. `first` is left
/// to the caller.
LostRun lost_between(const CameraStamps& camera, const CameraClock& clock, Nanoseconds last,
                     Nanoseconds next);

/// When the start-up is over: frames are lost at one rate before and at a clearly lower one after
/// (at least a third; at least a tenth of the frames before; the likelihood settles where), and
/// they are lost from the beginning on. Cameras
/// that start after `range.begin` count as losing frames until then. `period` of the ticks, ns.
std::optional<Nanoseconds> find_start_up_end(std::span<const CameraSync> cameras,
                                             const std::vector<CameraClock>& clocks,
                                             const std::vector<std::vector<Nanoseconds>>& times,
                                             const TimeRange& range, double period);

}  // namespace raystage
