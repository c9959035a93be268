// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "rig/delaunay.h"

namespace raystage {

/// The best-fit plane of an array's camera centres, with axes in it and what the centres span.
struct ArrayPlane {
  int dimension = 0;               ///< 0: one distinct centre, 1: a line, 2: a plane or a cloud
  std::vector<int> distinct;       ///< centres that are not coincident with an earlier one
  std::vector<GridPoint> snapped;  ///< of `distinct`, along (along, up), units of 2^-26 extent
  /// Right-handed, unit, world: `normal` against the mean viewing direction; `along` is the line's
  /// direction where dimension is 1.
  Eigen::Vector3d along = Eigen::Vector3d::UnitX();
  Eigen::Vector3d up = Eigen::Vector3d::UnitY();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
};

/// Centres closer than 1e-9 of the extent (the diagonal of the bounding box) are one, as are those
/// that fall on one point of the snapped plane; all closer than 1e-7 of it to a line are collinear.
/// `viewing_directions`: unit, world, one per centre. Throws Error (bad input) without a centre or
/// with one that is not finite.
ArrayPlane fit_array_plane(std::span<const Eigen::Vector3d> centres,
                           std::span<const Eigen::Vector3d> viewing_directions);

}  // namespace raystage
