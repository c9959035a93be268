// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/common/view.h"

namespace raystage::planning {

/// Returns the view without lens distortion, as it is rendered.
inline render::VirtualCamera ideal_view(render::VirtualCamera view) {
  view.intrinsics.distortion = {};
  return view;
}

}  // namespace raystage::planning
