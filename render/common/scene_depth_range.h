// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "render/common/method.h"
#include "store/scene_depth_range.h"

namespace raystage {

/// Returns the depth range of the scene in metres in front of the array: the one in the take, or
/// the method's options `near` and `far` where they are above 0. Throws Error (bad input), naming
/// `method`, where neither gives a range or where far is smaller than near.
DepthRange scene_depth_range(const MethodOptions& options, const Take& take,
                             std::string_view method);

}  // namespace raystage
