// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "store/processing/sync/resync.h"

namespace raystage::store {

/// A segment: consecutive frames of one camera that one clock fit can describe. A segment ends
/// where the recorder restarts, because the phase changes, and at a gap too long to count periods.
struct ClockSegment {
  std::size_t camera = 0;
  std::size_t first = 0, count = 0;  ///< frames of the camera
  std::size_t session = 0;           ///< restarts of the recorder before it
  int group = 0;  ///< of segments in one session of a node: their clock steps may coincide
};

/// Returns the segments, at least one for each camera, ordered by camera and frame. The groups of a
/// node are numbered in order of time.
std::vector<ClockSegment> split_into_segments(std::span<const CameraTimestamps> cameras);

/// Returns the frames of a segment, and the records of missing frames from its first to its last.
CameraTimestamps camera_timestamps(const CameraTimestamps& camera, const ClockSegment& part);

/// Returns for each segment the sum of its node's earlier clock steps (positive: ahead) when its
/// session began; a restart of the recorder does not undo them. `fits`: one for each segment.
std::vector<Nanoseconds> session_clock_offsets(std::span<const ClockSegment> parts,
                                               std::span<const ClockFit> fits,
                                               std::span<const CameraTimestamps> cameras);

}  // namespace raystage::store
