// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <limits>
#include <memory>
#include <vector>

#include "render/view/method.h"

namespace raystage {

/// Where each ray of a view is in focus.
struct DepthMap {
  int width = 0, height = 0;  ///< pixels
  /// 1 / (planar depth along the view's axis), per metre, row-major; 0 for infinity, not-a-number
  /// where there is no depth. Behind the last pixel there is room for a vector to be read.
  std::vector<float> inverse;

  static constexpr std::size_t kRoom = 64;
  const float* row(int y) const {
    return inverse.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
  }
};

/// Channel Z, metres, of a flat EXR file, as our own views have it; its size is the display
/// window's. Pixels outside the data window, and such with a Z that is not above 0, have no depth.
/// Throws Error (bad input) where the file is missing, damaged, or without a Z.
DepthMap read_depth_map(const std::filesystem::path& file);

/// The map with each pixel repeated `factor` times along both axes.
DepthMap repeated(const DepthMap& map, int factor);

/// The file that the option `depth_map` names, relative to the take's folder; empty: none.
std::filesystem::path depth_map_file(const MethodOptions& options, const Take& take);

/// What the option `depth_map` names, of the size of the view asked for; null: nothing. The map has
/// the size of the picture that is wanted, also where that is rendered finer and averaged
/// (ViewRequest::supersampling). Throws Error (bad input) also where the sizes differ.
std::shared_ptr<const DepthMap> depth_map_of(const ViewRequest& request);

}  // namespace raystage
