// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "render/common/view.h"
#include "rig/rig.h"
#include "schemas/geometry.h"

namespace raystage::compose {

/// Returns the share, [0, 1], of the view's rays that no camera of the rig sees at any depth of the
/// scene. `scene`: depths in front of the array, metres; none: from a tenth of a metre to infinity.
/// An estimate before rendering: it tests 24 x 14 rays at 12 depths against the cameras' frames.
double uncovered_ray_share(const rig::Rig& rig, const render::VirtualCamera& view,
                           const std::optional<schemas::DepthRange>& scene);

}  // namespace raystage::compose
