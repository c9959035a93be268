// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "render/common/method.h"
#include "store/scene_depth_range.h"

namespace raystage {

/// Between which depths the scene lies, metres in front of the array: as the take says, or as the
/// method's options `near` and `far` do where they are above 0. Throws Error (bad input), naming
/// `method`, where neither says, or far is nearer than near.
DepthRange scene_depth_range(const MethodOptions& options, const Take& take,
                             std::string_view method);

}  // namespace raystage
