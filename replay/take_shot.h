// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "schemas/shot_document.h"
#include "store/take.h"
#include "store/timeline.h"

namespace raystage::replay {

/// Returns a shot that shows a whole take, for a viewer: one light field layer, a camera at the
/// centre of the array with the lens of its cameras, focused at the optimal focal depth (thesis
/// eq. 2.2; 5 m if the take has no depth range), one frame per tick. `path`: of the take, relative
/// to the folder of the shot.
schemas::ShotDocument make_take_shot(const store::Take& take, const store::Timeline& timeline,
                                     const std::string& path);

}  // namespace raystage::replay
