// SPDX-License-Identifier: Apache-2.0
#include "calibrate/geometry/opencv_pose.h"

#include <opencv2/calib3d.hpp>

namespace raystage::calibrate {

rig::Pose pose_from_opencv_matrix(const cv::Mat& rotation, const cv::Mat& translation) {
  // Our cameras look along -z with y up.
  const Eigen::Matrix3d ours_from_opencv = Eigen::Vector3d(1, -1, -1).asDiagonal();
  Eigen::Matrix3d turned;
  for (int row = 0; row < 3; ++row) {
    for (int column = 0; column < 3; ++column)
      turned(row, column) = rotation.at<double>(row, column);
  }
  const Eigen::Vector3d moved(translation.at<double>(0), translation.at<double>(1),
                              translation.at<double>(2));
  const Eigen::Matrix3d camera_from_world = ours_from_opencv * turned;
  return {camera_from_world.transpose(), -turned.transpose() * moved};
}

rig::Pose pose_from_opencv(const cv::Mat& turn, const cv::Mat& translation) {
  cv::Mat rotation;
  cv::Rodrigues(turn, rotation);
  return pose_from_opencv_matrix(rotation, translation);
}

}  // namespace raystage::calibrate
