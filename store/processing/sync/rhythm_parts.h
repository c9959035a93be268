// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "store/processing/sync/resync.h"

namespace raystage {

/// Consecutive frames of one camera that one rhythm can go through. A camera starts anew, at a
/// phase of its own, where its recorder does; and over a long gap its periods cannot be counted.
struct RhythmPart {
  std::size_t camera = 0;
  std::size_t first = 0, count = 0;  ///< frames of the camera
  std::size_t session = 0;           ///< restarts of the recorder before it
  int group = 0;                     ///< parts of one node's session: their clock may step together
};

/// At least one part for each camera, by camera and frame. Groups are numbered such that those of a
/// node follow each other in time.
std::vector<RhythmPart> rhythm_parts(std::span<const CameraStamps> cameras);

/// The frames of a part, and the records of those missing from its first frame to its last.
CameraStamps stamps_of(const CameraStamps& camera, const RhythmPart& part);

/// For each part how far its node's clock had stepped ahead when the part's session began: nobody
/// set it back when the recorder started anew. `fits` as the parts.
std::vector<Nanoseconds> steps_before(std::span<const RhythmPart> parts,
                                      std::span<const ClockFit> fits,
                                      std::span<const CameraStamps> cameras);

}  // namespace raystage
