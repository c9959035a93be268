// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "store/archive.h"
#include "store/lost_frames.h"

namespace raystage::store {

/// Returns the intact frame that is nearest to a frame, or nullopt if the nearest ones are rotten.
/// Frames that the archive has lost with its end do not count: the search begins before them.
inline std::optional<int> intact_frame_near(const ArchiveReader& archive, int frame) {
  constexpr int kMaxDistance = 16;  // each frame is read
  const auto frames = static_cast<int>(archive.frames().size());
  while (frame > 0 && frame < frames && is_lost(archive, archive.frames()[frame])) --frame;
  for (int distance = 0; distance <= kMaxDistance; ++distance) {
    for (const int candidate : {frame - distance, frame + distance}) {
      if (candidate < 0 || candidate >= frames) continue;
      if (!archive.is_rotten(candidate)) return candidate;
    }
  }
  return std::nullopt;
}

}  // namespace raystage::store
