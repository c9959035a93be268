// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "rig/rig.h"
#include "store/frames/frame_cache.h"

namespace raystage {

/// The light field of one instant: which cameras have a frame, and who neighbours whom then.
struct Instant {
  const Rig* rig = nullptr;
  FrameCache* cache = nullptr;
  /// Per camera of the rig: its frame, or -1 where it has none at this instant.
  std::vector<int> frame_of_camera;
  /// Cells of the cameras present, and of all that could be (those not left out): rays are blended
  /// by the first, RenderedView::coverage is counted by the second. Equal when nobody is absent.
  std::shared_ptr<const Topology> present, complete;

  bool is_present(int camera) const {
    return frame_of_camera[static_cast<std::size_t>(camera)] >= 0;
  }
};

}  // namespace raystage
