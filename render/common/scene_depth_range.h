// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string_view>

#include "render/common/method_options.h"
#include "store/scene_depth_range.h"

namespace raystage::render {

/// The options of methods that search for surfaces in the depth range of the scene.
inline constexpr OptionSpec kNearOption =
    number_option("near", 0, 0, 1e9,
                  "nearest depth of the scene, metres in front of the array; 0: from the take");
inline constexpr OptionSpec kFarOption =
    number_option("far", 0, 0, 1e12,
                  "farthest depth of the scene, metres in front of the array; 0: from the take");

/// Returns the depth range of the scene in metres in front of the array. It is the one in the take,
/// or the method's options `near` and `far` where they are above 0. Throws Error (bad input),
/// naming `method`, where neither gives a range or where far is smaller than near.
schemas::DepthRange scene_depth_range(const MethodOptions& options, const store::Take& take,
                                      std::string_view method);

}  // namespace raystage::render
