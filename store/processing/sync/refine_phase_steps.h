// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "store/processing/sync/line_fit.h"

namespace raystage::store {

/// Scales in ns of the cost of an early and of a late frame. `early_share`: the fraction of a
/// period before a slot that belongs to the slot.
struct DelayLikelihood {
  double early_scale = 0, late_scale = 0, early_share = 0.5;
};
/// Moves each phase step by up to two frames to the position at which its neighbours fit the line
/// best; detection by phase alone is less exact. Does not use or change slots.
void refine_phase_steps(const CameraLine& camera, const DelayLikelihood& likelihood);

}  // namespace raystage::store
