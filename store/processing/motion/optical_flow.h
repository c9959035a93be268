// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <memory>

#include "base/image.h"
#include "store/jpeg/rgb_image.h"

namespace raystage::store {

/// The brightness of a frame, from which motion is estimated: codes 0 to 255.
using Luma = Image<std::uint8_t>;

/// A frame of one camera with its luma.
struct FlowImage {
  RgbImage rgb;
  Luma luma;
};
/// Returns the image with its luma.
FlowImage make_flow_image(RgbImage image);

/// A displacement in pixels: x to the right, y down.
struct FlowVector {
  float x = 0, y = 0;
};

/// The displacement of each pixel of one frame to its position in another.
using FlowField = Image<FlowVector>;

class FlowAlgorithm;

/// Estimates dense optical flow (OpenCV's DIS: Kroeger et al., "Fast optical flow using dense
/// inverse search", ECCV 2016), followed by a median filter. Keeps scratch memory; not thread-safe.
/// Deterministic if OpenCV uses one thread (use_one_opencv_thread()). The first estimate loads
/// OpenCV (motion_module.h).
class OpticalFlowEstimator {
 public:
  OpticalFlowEstimator();
  ~OpticalFlowEstimator();
  OpticalFlowEstimator(OpticalFlowEstimator&&) noexcept;
  OpticalFlowEstimator& operator=(OpticalFlowEstimator&&) noexcept;

  /// Returns the flow from one frame to another. Throws Error (bad input) if sizes differ or a side
  /// exceeds 32766 pixels. The flow is 0 if a side is below 12 pixels.
  FlowField estimate(const Luma& from, const Luma& to);

 private:
  std::unique_ptr<FlowAlgorithm> algorithm_;  // from the first estimate on
};

/// Restricts OpenCV to one thread in the whole process: the result of DIS depends on their number.
void use_one_opencv_thread();

}  // namespace raystage::store
