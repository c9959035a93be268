// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <string>

#include "compose/camera/animation_curves.h"
#include "schemas/shot_document.h"

namespace raystage {

/// Where a mesh stands, at any fractional frame: smooth curves through its keys, each property by
/// itself; before the first and after the last it rests.
class AnimatedTransform {
 public:
  /// Throws Error (bad input), with `where` in it, for keys that are not finite, a scale of 0, or
  /// a quaternion of length 0.
  AnimatedTransform(const ShotDocument::Geometry& geometry, const std::string& where);

  Eigen::Affine3d world_from_object(double frame) const;

 private:
  AnimationChannel<Eigen::Vector3d> position_;
  AnimationChannel<Eigen::Quaterniond> orientation_;
  AnimationChannel<double> scale_;
};

}  // namespace raystage
