// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <string>
#include <vector>

#include "render/common/view.h"
#include "testing/render/synthetic_take.h"

namespace raystage::testing {

struct ExtremeView {
  std::string name;
  std::string array;           ///< name of the array to render; see make_extreme_array()
  render::VirtualCamera view;  ///< in the take's world
  Eigen::Vector4d plane;       ///< focal plane in the take's world
  bool blank = false;          ///< no ray can be reconstructed on the plane
};

/// Returns a small array. "grid": 3 x 3, 6 cm apart, in the plane z = 0 around the origin, looking
/// at the painted plane 4 m ahead. "flat": the same with near = far. "far off": the same with its
/// origin at 1e7 m along every axis. "double": the same with a duplicate camera. Others: "row",
/// "diagonal", "coincident", "single".
SyntheticTake make_extreme_array(const std::string& name);

std::vector<ExtremeView> extremes();

}  // namespace raystage::testing
