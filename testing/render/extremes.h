// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "render/common/view.h"
#include "testing/render/synthetic_take.h"

namespace raystage::testing {

/// A view at an extreme of what may be asked for, or an ordinary one to compare with.
struct ExtremeView {
  std::string name;
  std::string array;      ///< name of the array that it looks through: make_extreme_array()
  VirtualCamera view;     ///< in the take's world
  Eigen::Vector4d plane;  ///< to focus on, in the take's world
  bool blank = false;     ///< no ray can be reconstructed on the plane
};

/// Small arrays: "grid" (3 x 3, 6 cm apart, in the plane z = 0 around the origin, looking at the
/// painted plane 4 m ahead), the same "flat" (near = far), "far off" (its origin at 1e7 m along
/// every axis), with a "double" camera; "row", "diagonal" (collinear), "coincident", "single".
SyntheticTake make_extreme_array(const std::string& name);

std::vector<ExtremeView> extremes();

}  // namespace raystage::testing
