// SPDX-License-Identifier: Apache-2.0
// Internal to calibrate/geometry: conversion of OpenCV's poses.
#pragma once

#include <opencv2/core.hpp>

#include "rig/pose.h"

namespace raystage::calibrate {

/// Converts a pose of OpenCV, x_in_camera = rotation(turn) x + translation with z forwards and y
/// down; `turn`: a rotation vector.
rig::Pose pose_from_opencv(const cv::Mat& turn, const cv::Mat& translation);

/// Converts a pose with a rotation matrix instead of a rotation vector.
rig::Pose pose_from_opencv_matrix(const cv::Mat& rotation, const cv::Mat& translation);

}  // namespace raystage::calibrate
