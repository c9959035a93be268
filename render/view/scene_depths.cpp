// SPDX-License-Identifier: Apache-2.0
#include "render/view/scene_depths.h"

namespace raystage {

DepthRange scene_depths(const MethodOptions& options, const Take& take, std::string_view method) {
  return scene_depths(take, {options.number("near"), options.number("far")}, method,
                      "Give the options near and far, in metres in front of the array");
}

}  // namespace raystage
