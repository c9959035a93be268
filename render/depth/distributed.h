// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/depth/depth.h"

namespace raystage::depth {

// Method `depth` on several hosts (ViewRequest::group). Each solves the depths of its own cameras,
// with the frames and the maps of their neighbours, once per light field frame. For a view each
// warps its cameras' depths (hypotheses), host 0 takes the depth that most agree on, and each adds
// the samples of its cameras at these depths; the two rounds in which cameras that differ from the
// mean lose weight (blend_reweighted()) exchange the mean. All hosts must call in the same order.

/// Returns this host's share of a view: plane 0 the weighted samples, plane 1, of host 0 alone, the
/// inverse depth and alpha of each pixel.
Contribution contribute(const ViewRequest& request);

/// Returns the view of all hosts' contributions. Does not fill RenderedView::cameras.
RenderedView combine(const ViewRequest& request, const std::vector<PixelValues>& planes);

}  // namespace raystage::depth
