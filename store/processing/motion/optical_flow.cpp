// SPDX-License-Identifier: Apache-2.0
#include "store/processing/motion/optical_flow.h"

#include <utility>

#include "store/processing/motion/motion_module.h"

namespace raystage::store {

FlowImage make_flow_image(RgbImage image) {
  Luma luma(image.width, image.height);
  for (std::size_t i = 0; i < luma.values.size(); ++i) {
    const std::uint8_t* p = &image.values[3 * i];
    luma.values[i] = static_cast<std::uint8_t>((77 * p[0] + 150 * p[1] + 29 * p[2] + 128) >> 8);
  }
  return {std::move(image), std::move(luma)};
}

OpticalFlowEstimator::OpticalFlowEstimator() = default;
OpticalFlowEstimator::~OpticalFlowEstimator() = default;
OpticalFlowEstimator::OpticalFlowEstimator(OpticalFlowEstimator&&) noexcept = default;
OpticalFlowEstimator& OpticalFlowEstimator::operator=(OpticalFlowEstimator&&) noexcept = default;

FlowField OpticalFlowEstimator::estimate(const Luma& from, const Luma& to) {
  if (!algorithm_) algorithm_ = motion_module().make_flow();
  return algorithm_->estimate(from, to);
}

void use_one_opencv_thread() { motion_module().use_one_thread(); }

}  // namespace raystage::store
