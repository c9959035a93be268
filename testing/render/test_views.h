// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/common/view.h"

namespace raystage::testing {

/// Returns the mean of A over all pixels.
inline double mean_alpha(const render::RenderedView& view) {
  double sum = 0;
  for (std::size_t i = 3; i < view.rgba.size(); i += 4) sum += static_cast<double>(view.rgba[i]);
  return sum / static_cast<double>(view.coverage.size());
}

}  // namespace raystage::testing
