// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <string>

#include "compose/exr/exr_layout.h"
#include "render/common/view.h"

namespace raystage::testing {

/// Returns layers with colours, depth, coverage and measures. Keeps references to the view.
inline ExrView exr_view(const RenderedView& view, const std::string& name = "") {
  constexpr float kInfinity = std::numeric_limits<float>::infinity();
  ExrView result{name, {}};
  result.layers.push_back({"", {"R", "G", "B", "A"}, true, view.rgba, 0});
  result.layers.push_back({"depth", {"Z"}, false, view.z, kInfinity});
  result.layers.push_back({"lf", {"coverage"}, false, view.coverage, 0});
  if (!view.cameras.empty()) {
    result.layers.push_back({"lf", {"cameras"}, false, view.cameras, 0});
    result.layers.push_back({"lf", {"nearest"}, false, view.nearest_ray, kInfinity});
  }
  return result;
}

}  // namespace raystage::testing
