// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/depth/depth.h"

namespace raystage::render::depth {

// Method `depth` on several hosts (ViewRequest::group). All hosts must call in the same order.

/// Returns this host's contribution to a view. Planes 0 and 2: the weighted samples at the surfaces
/// in front, and at those behind them in pixels of two. Planes 1 and 3, of host 0 alone: of each
/// pixel the inverse depth and alpha in front, the inverse depth behind (negative: there is one
/// surface) and FrontShare::visible; and the alpha behind.
Contribution contribute(const ViewRequest& request);

/// Returns the view from the contributions of all hosts. Does not fill RenderedView::cameras.
RenderedView combine(const ViewRequest& request, const std::vector<PixelValues>& planes);

}  // namespace raystage::render::depth
