// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "render/common/rank_communicator.h"
#include "render/depth/depth.h"

namespace raystage::depth {

/// The depths of the cameras that this host holds; maps of others are empty.
struct LocalDepths {
  CameraDepths depths;
  std::vector<std::string> notes;  ///< for people
};

/// Returns them for a light field frame. They are solved together with the other hosts where they
/// are not among those of the last kLocalDepthFrames frames that were asked for: the same on all
/// hosts, which ask in the same order. Not stored on disk.
std::shared_ptr<const LocalDepths> local_depths(const ViewRequest& request,
                                                const DepthViewSettings& settings,
                                                const RankCommunicator& group);
inline constexpr std::size_t kLocalDepthFrames = 2;

}  // namespace raystage::depth
