// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

#include "store/processing/sync/clock_segments.h"
#include "store/processing/sync/resync.h"

namespace raystage::store {

/// Resynchronisation of one segment of a camera's frames, from the clock fit of the segment.
struct SegmentSync {
  CameraClock clock;               ///< offset_ns includes earlier sessions' steps
  CameraSync sync;                 ///< frames and periods count from the segment's first
  std::vector<Nanoseconds> times;  ///< of each frame, corrected; kExcludedTime: excluded
};

/// Resynchronises one segment. `camera`: the segment's frames (camera_timestamps()); `offset`: of
/// its clock, ns; `base`: the time that the fit's times count from, ns. `exact`: time
/// stamps are exposure times.
SegmentSync sync_segment(const CameraTimestamps& camera, const ClockFit& fit, Nanoseconds offset,
                         Nanoseconds base, bool exact);

/// Joins the results of sync_segment() for the consecutive segments of one camera. Its clock and
/// rate are those of its longest segment. Counts frames lost in a gap within a session, but none
/// where the recorder restarted.
SegmentSync join_segments(const CameraTimestamps& camera, std::span<const ClockSegment> parts,
                          std::span<const ClockFit> fits, std::span<const SegmentSync> synced,
                          Nanoseconds offset);

}  // namespace raystage::store
