// SPDX-License-Identifier: Apache-2.0
// Inside calibrate/geometry only: poses as OpenCV has them.
#pragma once

#include <opencv2/core.hpp>

#include "rig/pose.h"

namespace raystage {

/// From OpenCV's x_in_camera = rotation(turn) x + translation, its camera looking along z with y
/// down; `turn`: a rotation vector.
Pose pose_from_opencv(const cv::Mat& turn, const cv::Mat& translation);

/// The same with a rotation matrix.
Pose pose_from_opencv_matrix(const cv::Mat& rotation, const cv::Mat& translation);

}  // namespace raystage
