// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Geometry>
#include <string>

#include "compose/camera/curves.h"
#include "schemas/shot_document.h"

namespace raystage {

/// Where a mesh stands, at any fractional frame: smooth curves through its keys, each property by
/// itself; before the first and after the last it rests.
class Placement {
 public:
  /// Throws Error (bad input), with `where` in it, for keys that are not finite, a scale of 0, or
  /// a quaternion of length 0.
  Placement(const ShotDocument::Geometry& geometry, const std::string& where);

  Eigen::Affine3d world_from_object(double frame) const;

 private:
  Channel<Eigen::Vector3d> position_;
  Channel<Eigen::Quaterniond> orientation_;
  Channel<double> scale_;
};

}  // namespace raystage
