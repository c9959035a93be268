// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "store/processing/sync/resync.h"
#include "store/processing/sync/rhythm_parts.h"

namespace raystage {

/// What the fit of one rhythm says about its part of a camera's frames.
struct PartSync {
  CameraClock clock;               ///< offset_ns holds earlier sessions' steps, too
  CameraSync sync;                 ///< frames and periods count from the part's first
  std::vector<Nanoseconds> times;  ///< of each frame, corrected; kNoTime: left out
};

/// `camera`: the part's frames (stamps_of()); `offset` of its clock and `base` of the fit's times,
/// ns. `exact`: stamps are taken at their word.
PartSync sync_part(const CameraStamps& camera, const ClockFit& fit, Nanoseconds offset,
                   Nanoseconds base, bool exact);

/// A whole camera: what sync_part() says about each of its parts, which follow each other. Its
/// clock and rate are those of its longest part. Frames lost over a gap inside a session are
/// counted; none are lost where the recorder started anew.
PartSync join_parts(const CameraStamps& camera, std::span<const RhythmPart> parts,
                    std::span<const ClockFit> fits, std::span<const PartSync> synced,
                    Nanoseconds offset);

}  // namespace raystage
