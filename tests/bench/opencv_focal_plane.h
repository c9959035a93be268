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

/// The peer: every camera's image warped onto the view by its homography, times its weight, added,
/// in linear light. Of the first frame of each camera.
class OpenCvFocalPlane {
 public:
  explicit OpenCvFocalPlane(const Take& take);

  /// `crop`: warp only the rectangle of the view in which the camera has a weight.
  cv::Mat render(const VirtualCamera& view, const Eigen::Vector4d& plane, bool crop) const;
  /// Every camera that gathers something, times its weight map, added; then by the maps' sum.
  cv::Mat render_aperture(const VirtualCamera& view, const Eigen::Vector4d& plane,
                          double radius) const;

 private:
  cv::Mat source_from_view(const PlaneProjection& projection, std::size_t camera,
                           const cv::Rect& region) const;
  std::vector<cv::Mat> draw_weights(const VirtualCamera& view) const;

  const Take& take_;
  std::vector<cv::Mat> images_;
  Topology topology_;
};

}  // namespace raystage
