// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "render/common/rank_communicator.h"
#include "render/depth/view_sources.h"

namespace raystage::render::depth {

/// Rows of tiles [first, end) of a view.
struct TileRows {
  int first = 0, end = 0;
};
/// Fills a plane of host 0 with the view's fits over the positions of the cameras
/// (weigh_angular_fit()); 0 on other hosts. `bands`: all rows of tiles, in parts whose samples fit
/// the memory. Collective.
void fit_angular_together(const ViewRequest& request, const DepthViewPlan& plan,
                          const ViewSources& sources, const RankCommunicator& group,
                          std::span<const TileRows> bands, PixelValues& plane);

}  // namespace raystage::render::depth
