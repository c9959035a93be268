// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "store/processing/motion/motion_module.h"

namespace raystage::store {

/// Returns an estimator of flow by OpenCV's DIS, see OpticalFlowEstimator.
std::unique_ptr<FlowAlgorithm> make_opencv_flow();

/// Applies a 5 x 5 median filter to x and y in place, which removes outliers. Source: Sun, Roth and
/// Black, "Secrets of optical flow estimation and their principles", CVPR 2010.
void median_filter_flow(FlowField& field);

}  // namespace raystage::store
