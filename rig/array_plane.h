// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "rig/delaunay.h"

namespace raystage::rig {

/// The best-fit plane of an array's camera centres, axes in it, and the dimension of their span.
struct ArrayPlane {
  int dimension = 0;               ///< 0: one distinct centre, 1: a line, 2: a plane or a cloud
  std::vector<int> distinct;       ///< indices of centres not coincident with an earlier one
  std::vector<GridPoint> snapped;  ///< `distinct` on the axes (along, up), in 2^-26 of the extent
  /// Right-handed unit axes in the world. `normal` points against the mean viewing direction.
  /// `along` is the line's direction if dimension is 1.
  Eigen::Vector3d along = Eigen::Vector3d::UnitX();
  Eigen::Vector3d up = Eigen::Vector3d::UnitY();
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
};

/// Fits the plane to `centres` (world, metres). Centres closer than 1e-9 of the extent (the
/// diagonal of the bounding box), or snapped to the same point, are coincident. The array is
/// collinear if all centres are closer than 1e-7 of the extent to a line, or if their extent
/// perpendicular to it is less than 0.1 of the smallest spacing of stations (camera_stations.h)
/// along it; then one centre per station is distinct. `viewing_directions`: unit, world, one per
/// centre. Throws Error (bad input) for no centre or one that is not finite.
ArrayPlane fit_array_plane(std::span<const Eigen::Vector3d> centres,
                           std::span<const Eigen::Vector3d> viewing_directions);

}  // namespace raystage::rig
