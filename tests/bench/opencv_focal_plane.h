// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <opencv2/core.hpp>
#include <vector>

#include "render/common/plane_projection.h"
#include "render/common/view.h"
#include "rig/topology.h"
#include "store/take.h"

namespace raystage {

/// The OpenCV version: warps the first frame of every camera onto the view by its homography and
/// adds them by weight, in linear light.
class OpenCvFocalPlane {
 public:
  explicit OpenCvFocalPlane(const store::Take& take);

  /// Returns the focal-plane view. `crop`: warp only the rectangle of the view in which the camera
  /// has a weight.
  cv::Mat render(const render::VirtualCamera& view, const Eigen::Vector4d& plane, bool crop) const;
  /// Adds every contributing camera times its weight map, and divides by the sum of the maps.
  cv::Mat render_aperture(const render::VirtualCamera& view, const Eigen::Vector4d& plane,
                          double radius) const;

 private:
  cv::Mat source_from_view(const render::PlaneProjection& projection, std::size_t camera,
                           const cv::Rect& region) const;
  std::vector<cv::Mat> draw_weights(const render::VirtualCamera& view) const;

  const store::Take& take_;
  std::vector<cv::Mat> images_;
  rig::Topology topology_;
};

}  // namespace raystage
