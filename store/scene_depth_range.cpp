// SPDX-License-Identifier: Apache-2.0
#include "store/scene_depth_range.h"

#include <string>

#include "base/error.h"

namespace raystage::store {

schemas::DepthRange scene_depth_range(const Take& of, const schemas::DepthRange& given,
                                      std::string_view what, std::string_view what_to_do) {
  schemas::DepthRange scene = of.document().depth_range.value_or(schemas::DepthRange{});
  if (given.near > 0) scene.near = given.near;
  if (given.far > 0) scene.far = given.far;
  const std::string take = of.folder().string();
  if (!(scene.near > 0 && scene.far > 0)) {
    throw Error::bad_input(std::string(what) + ": the depth range of the scene is unknown", take,
                           std::string(what_to_do));
  }
  if (scene.far < scene.near) {
    throw Error::bad_input(std::string(what) + ": far is less than near", take,
                           "Set near and far in metres, near to the smaller depth");
  }
  return scene;
}

}  // namespace raystage::store
