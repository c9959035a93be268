// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "store/processing/sync/resync.h"
#include "store/processing/sync/rhythm_parts.h"

namespace raystage {

/// Resynchronisation of one segment of a camera's frames, from the clock fit of the segment.
struct PartSync {
  CameraClock clock;               ///< offset_ns holds earlier sessions' steps, too
  CameraSync sync;                 ///< frames and periods count from the part's first
  std::vector<Nanoseconds> times;  ///< of each frame, corrected; kNoTime: left out
};

/// Resynchronises one segment. `camera`: the segment's frames (stamps_of()); `offset`: of its
/// clock, ns; `base`: the time that the fit's times count from, ns. `exact`: trust the stamps as
/// exposure times.
PartSync sync_part(const CameraStamps& camera, const ClockFit& fit, Nanoseconds offset,
                   Nanoseconds base, bool exact);

/// Joins the results of sync_part() for the consecutive segments of one camera. Its clock and rate
/// are those of its longest segment. Counts frames lost in a gap within a session, but none where
/// the recorder restarted.
PartSync join_parts(const CameraStamps& camera, std::span<const RhythmPart> parts,
                    std::span<const ClockFit> fits, std::span<const PartSync> synced,
                    Nanoseconds offset);

}  // namespace raystage
