// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "rig/rig.h"
#include "store/take.h"

namespace raystage::store {

/// A frame of a take: camera, and index in its archive.
struct FrameRef {
  int camera = 0, frame = 0;
  bool operator==(const FrameRef&) const = default;
};

/// Returns the cameras in an order in which each is next to the one before: along the rows of the
/// grid, every second row backwards (serpentine), if all cameras have a row and column; otherwise
/// from the camera farthest from the centre always to the nearest one that is left.
std::vector<int> serpentine_order(const rig::Rig& rig);

/// Returns the frames of cameras by time: of each instant at most one frame a camera, in the order
/// of `cameras`. An instant has the frames within half a frame interval of its earliest; the
/// interval is the median of those of the camera with most frames. The instants of a camera's
/// frames are in the order of the frames. `first`, `last`: frames at other times are left out.
std::vector<std::vector<FrameRef>> frames_by_instant(const Take& take,
                                                     const std::vector<int>& cameras,
                                                     Nanoseconds first, Nanoseconds last);

}  // namespace raystage::store
