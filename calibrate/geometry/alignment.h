// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <span>

#include "calibrate/geometry/array_model.h"

namespace raystage::calibrate {

/// A similarity transform: to = scale * rotation * from + translation.
struct SimilarityTransform {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  double scale = 1;
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator()(const Eigen::Vector3d& from) const {
    return scale * (rotation * from) + translation;
  }
  rig::Pose operator()(const rig::Pose& from) const {
    return {rotation * from.world_from_camera_rotation, (*this)(from.position)};
  }
};

/// Returns the inverse pose: camera_from_world of a world_from_camera.
inline rig::Pose inverse(const rig::Pose& pose) {
  return {pose.world_from_camera_rotation.transpose(), pose.camera_from_world({0, 0, 0})};
}

/// Returns the similarity that aligns `from` with `to`: least squares over the centres (Umeyama
/// 1991) and the viewing directions. A direction has the weight of a centre at the mean distance of
/// the centres from their mean. Where the centres of either are in one place, directions alone
/// determine the rotation, and the scale is 1. Both have the same size, at least two.
SimilarityTransform estimate_similarity(std::span<const rig::Pose> from,
                                        std::span<const rig::Pose> to);

/// Transforms the poses and points of a model, as far as they are known.
void apply(const SimilarityTransform& similarity, ArrayModel& model);

}  // namespace raystage::calibrate
