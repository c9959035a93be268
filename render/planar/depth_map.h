// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <filesystem>
#include <limits>
#include <memory>
#include <optional>
#include <utility>
#include <vector>

#include "render/common/method.h"

namespace raystage::render {

/// The focus distance of each ray of a view.
struct DepthMap {
  int width = 0, height = 0;  ///< pixels
  /// 1 / (planar depth along the view's axis), per metre, row-major; 0 for infinity, not-a-number
  /// without depth. Followed by padding, so that a vector can be read at the last pixel.
  std::vector<float> inverse;

  static constexpr std::size_t kReadPadding = 64;
  const float* row(int y) const { return inverse.data() + static_cast<std::size_t>(y) * width; }
};

/// Reads channel Z, in metres, of a flat EXR file, as our views contain it; the size is that of the
/// display window. Pixels outside the data window and pixels whose Z is not above 0 have no depth.
/// Throws Error (bad input) where the file is missing, damaged or has no Z.
DepthMap read_depth_map(const std::filesystem::path& file);

/// Returns the file that the option `depth_map` names, relative to the take's folder; empty if
/// unset.
std::filesystem::path depth_map_file(const MethodOptions& options, const store::Take& take);

/// The depths of a view's pixels. The map has the size of the output view, also where that is
/// supersampled or rendered in bands (ViewRequest::supersampling, first_row). Of a supersampled
/// view only one run is held.
class ViewDepths {
 public:
  ViewDepths(std::shared_ptr<const DepthMap> map, int supersampling, int first_row)
      : map_(std::move(map)), factor_(supersampling), first_row_(first_row) {}

  /// Returns the value of DepthMap::inverse for a pixel of the view.
  float at(int x, int y) const { return map_->row(first_row_ + y / factor_)[x / factor_]; }
  /// Returns the values of pixels [begin, end) of row y, followed by DepthMap::kReadPadding values:
  /// a pointer into the map or into `scratch`.
  const float* run(int begin, int end, int y, std::vector<float>& scratch) const;

 private:
  std::shared_ptr<const DepthMap> map_;
  int factor_, first_row_;
};

/// Reads the map that the option `depth_map` names; nullopt if unset. Throws Error (bad input) as
/// read_depth_map(), and where the map's size differs from the output view's.
std::optional<ViewDepths> make_view_depths(const ViewRequest& request);

}  // namespace raystage::render
