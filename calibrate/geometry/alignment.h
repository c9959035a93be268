// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <span>

#include "calibrate/geometry/array_model.h"

namespace raystage {

/// A rotation, a scale and a translation: to = scale * rotation * from + translation.
struct SimilarityTransform {
  Eigen::Matrix3d rotation = Eigen::Matrix3d::Identity();
  double scale = 1;
  Eigen::Vector3d translation = Eigen::Vector3d::Zero();

  Eigen::Vector3d operator()(const Eigen::Vector3d& from) const {
    return scale * (rotation * from) + translation;
  }
  Pose operator()(const Pose& from) const {
    return {rotation * from.world_from_camera_rotation, (*this)(from.position)};
  }
};

/// The way back: camera_from_world of a world_from_camera.
inline Pose inverse(const Pose& pose) {
  return {pose.world_from_camera_rotation.transpose(), pose.camera_from_world({0, 0, 0})};
}

/// The similarity that brings poses nearest to others: by their centres (least squares, Umeyama
/// 1991) and their directions, each of which weighs as a centre as far out as they are in the mean.
/// As many of both, two at least.
SimilarityTransform estimate_similarity(std::span<const Pose> from, std::span<const Pose> to);

/// All that is found, in another world.
void apply(const SimilarityTransform& similarity, ArrayModel& model);

}  // namespace raystage
