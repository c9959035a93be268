// SPDX-License-Identifier: Apache-2.0
#include "render/common/scene_depth_range.h"

namespace raystage::render {

schemas::DepthRange scene_depth_range(const MethodOptions& options, const store::Take& take,
                                      std::string_view method) {
  return store::scene_depth_range(
      take, {options.number("near"), options.number("far")}, method,
      "Set the options near and far, in metres in front of the array, or measure the range "
      "with `raystage plan epi`");
}

}  // namespace raystage::render
