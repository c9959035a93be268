// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "render/common/method.h"

namespace raystage {

/// Where each ray of a view is in focus.
struct DepthMap {
  int width = 0, height = 0;  ///< pixels
  /// 1 / (planar depth along the view's axis), per metre, row-major; 0 for infinity, not-a-number
  /// where there is no depth. Behind the last pixel there is room for a vector to be read.
  std::vector<float> inverse;

  static constexpr std::size_t kReadPadding = 64;
  const float* row(int y) const {
    return inverse.data() + static_cast<std::size_t>(y) * static_cast<std::size_t>(width);
  }
};

/// Channel Z, metres, of a flat EXR file, as our own views have it; its size is the display
/// window's. Pixels outside the data window, and such with a Z that is not above 0, have no depth.
/// Throws Error (bad input) where the file is missing, damaged, or without a Z.
DepthMap read_depth_map(const std::filesystem::path& file);

/// The file that the option `depth_map` names, relative to the take's folder; empty: none.
std::filesystem::path depth_map_file(const MethodOptions& options, const Take& take);

/// The depths of a view's pixels. The map is of the picture that is wanted, also where that is
/// rendered finer and averaged, or in parts (ViewRequest::supersampling, first_row); of a finer
/// view no more than a run is held.
class ViewDepths {
 public:
  ViewDepths(std::shared_ptr<const DepthMap> map, int supersampling, int first_row)
      : map_(std::move(map)), factor_(supersampling), first_row_(first_row) {}

  /// As DepthMap::inverse; pixel of the view.
  float at(int x, int y) const { return map_->row(first_row_ + y / factor_)[x / factor_]; }
  /// Those of pixels [begin, end) of row y, with DepthMap::kReadPadding behind them: the map's own,
  /// or in `scratch`.
  const float* run(int begin, int end, int y, std::vector<float>& scratch) const;

 private:
  std::shared_ptr<const DepthMap> map_;
  int factor_, first_row_;
};

/// By what the option `depth_map` names; none where it names nothing. Throws Error (bad input) also
/// where the map has not the size of the picture that is wanted.
std::optional<ViewDepths> make_view_depths(const ViewRequest& request);

}  // namespace raystage
