// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "render/common/rank_communicator.h"
#include "render/depth/depth.h"

namespace raystage::render::depth {

/// Returns the depths of the cameras that this host holds; maps of other cameras are empty. The
/// depths of the last kLocalDepthFrames light field frames are cached; others are estimated
/// together with the other hosts. All hosts must ask in the same order. Not stored on disk.
std::shared_ptr<const NotedDepths> local_depths(const ViewRequest& request,
                                                const DepthViewOptions& options,
                                                const RankCommunicator& group);
inline constexpr std::size_t kLocalDepthFrames = 2;

}  // namespace raystage::render::depth
