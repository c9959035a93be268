// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "store/processing/sync/resync.h"

namespace raystage {

/// A segment: consecutive frames of one camera that one clock fit can describe. A segment ends
/// where the recorder restarts, as the phase changes, and at a long gap, as its periods cannot be
/// counted.
struct RhythmPart {
  std::size_t camera = 0;
  std::size_t first = 0, count = 0;  ///< frames of the camera
  std::size_t session = 0;           ///< restarts of the recorder before it
  int group = 0;  ///< of segments in one session of a node: their clock steps may coincide
};

/// Returns the segments, at least one for each camera, ordered by camera and frame. The groups of a
/// node are numbered in order of time.
std::vector<RhythmPart> rhythm_parts(std::span<const CameraStamps> cameras);

/// Returns the frames of a segment, and the records of missing frames from its first to its last.
CameraStamps stamps_of(const CameraStamps& camera, const RhythmPart& part);

/// Returns for each segment the sum of its node's earlier clock steps (positive: ahead) when its
/// session began; a restart of the recorder does not undo them. `fits`: one for each segment.
std::vector<Nanoseconds> steps_before(std::span<const RhythmPart> parts,
                                      std::span<const ClockFit> fits,
                                      std::span<const CameraStamps> cameras);

}  // namespace raystage
