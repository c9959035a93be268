// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/depth/depth.h"

namespace raystage::render::depth {

// Method `depth` on several hosts (ViewRequest::group). All hosts must call in the same order.

/// Returns this host's contribution to a view. Plane 0: the weighted samples. Plane 1, of host 0
/// alone: the inverse depth and alpha of each pixel.
Contribution contribute(const ViewRequest& request);

/// Returns the view from the contributions of all hosts. Does not fill RenderedView::cameras.
RenderedView combine(const ViewRequest& request, const std::vector<PixelValues>& planes);

}  // namespace raystage::render::depth
