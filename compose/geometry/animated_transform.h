// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <string>

#include "compose/camera/animation_curves.h"
#include "schemas/shot_document.h"

namespace raystage::compose {

/// Transform of a mesh at any fractional frame: a smooth curve through the keys of each property,
/// constant before the first and after the last key.
class AnimatedTransform {
 public:
  /// Builds the curves. `where`: named by errors. Throws Error (bad input) for keys that are not
  /// finite, a scale that is not above 0, or a quaternion of length 0.
  AnimatedTransform(const schemas::ShotDocument::Geometry& geometry, const std::string& where);

  Eigen::Affine3d world_from_object(double frame) const;

 private:
  AnimationChannel<Eigen::Vector3d> position_;
  AnimationChannel<Eigen::Quaterniond> orientation_;
  AnimationChannel<double> scale_;
};

}  // namespace raystage::compose
