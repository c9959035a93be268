// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "schemas/geometry.h"
#include "store/take.h"

namespace raystage {

/// Between which depths the scene lies, metres in front of the array: as `given`; 0 in it: as the
/// take says. Throws Error (bad input), naming `what` wants to know and `what_to_do`, where neither
/// says, or far is nearer than near.
DepthRange scene_depth_range(const Take& take, const DepthRange& given, std::string_view what,
                             std::string_view what_to_do);

}  // namespace raystage
