// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "render/common/rank_communicator.h"
#include "render/depth/depth.h"

namespace raystage::depth {

/// The depths of the cameras that this host holds; maps of other cameras are empty.
struct LocalDepths {
  CameraDepths depths;
  std::vector<std::string> notes;  ///< for the user
};

/// Returns the local depths of a light field frame, estimated together with the other hosts unless
/// they are those of the last kLocalDepthFrames frames. All hosts must ask in the same order. Not
/// stored on disk.
std::shared_ptr<const LocalDepths> local_depths(const ViewRequest& request,
                                                const DepthViewSettings& settings,
                                                const RankCommunicator& group);
inline constexpr std::size_t kLocalDepthFrames = 2;

}  // namespace raystage::depth
