// SPDX-License-Identifier: Apache-2.0
#include "render/view/scene_depths.h"

#include <string>

#include "schemas/error.h"

namespace raystage {

DepthRange scene_depths(const ViewRequest& request, std::string_view method) {
  DepthRange scene = request.instant.take->document().depth_range.value_or(DepthRange{});
  if (const double near = request.options.number("near"); near > 0) scene.near = near;
  if (const double far = request.options.number("far"); far > 0) scene.far = far;
  const std::string take = request.instant.take->folder().string();
  if (!(scene.near > 0 && scene.far > 0)) {
    throw Error::bad_input(std::string(method) + " does not know how deep the scene is", take,
                           "Give the options near and far, in metres in front of the array");
  }
  if (scene.far < scene.near) {
    throw Error::bad_input(std::string(method) + ": far is nearer than near", take,
                           "Give near and far in metres, near first");
  }
  return scene;
}

}  // namespace raystage
