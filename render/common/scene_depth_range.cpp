// SPDX-License-Identifier: Apache-2.0
#include "render/common/scene_depth_range.h"

namespace raystage {

DepthRange scene_depth_range(const MethodOptions& options, const Take& take,
                             std::string_view method) {
  return scene_depth_range(take, {options.number("near"), options.number("far")}, method,
                           "Set the options near and far, in metres in front of the array");
}

}  // namespace raystage
