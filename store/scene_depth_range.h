// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "schemas/geometry.h"
#include "store/take.h"

namespace raystage::store {

/// Returns the depth range of the scene, in metres in front of the array: from `given`, with each 0
/// replaced by the value in the take. Throws Error (bad input) if neither gives a depth, or far is
/// less than near. The error contains `what` (who needs the range) and `what_to_do`.
schemas::DepthRange scene_depth_range(const Take& take, const schemas::DepthRange& given,
                                      std::string_view what, std::string_view what_to_do);

}  // namespace raystage::store
