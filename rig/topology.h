// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

namespace raystage::rig {

/// The neighbourhoods of the cameras (thesis 4.1.2): cells within which rays are interpolated. The
/// kind depends on the span of the camera centres; coincident cameras count once.
struct Topology {
  enum class Kind {
    kTriangles,  ///< the usual array: cells of three cameras
    kSegments,   ///< (nearly) collinear cameras: cells of two, each an infinite strip along `up`
    kPoint       ///< one distinct centre: one cell of one camera, valid for every ray
  };
  /// Indices into the centres; the unused ones are -1. Triangles run counter-clockwise as seen from
  /// the side that `normal` points to, or, if the array looks outwards, from outside.
  using Cell = std::array<int, 3>;

  Kind kind = Kind::kPoint;
  std::vector<Cell> cells;
  /// Unit normal of the best-fit plane of the centres, turned towards the back of the cameras
  /// (against the mean viewing direction).
  Eigen::Vector3d normal = Eigen::Vector3d::UnitZ();
  /// Unit vector in the plane, perpendicular to the line of a kSegments array; of a ring, its
  /// normal.
  Eigen::Vector3d up = Eigen::Vector3d::UnitY();
  /// The cells surround a volume, and cameras look away from it (rig/outward_topology.h). A ray
  /// passes between the cameras of the cell through which its line leaves the volume: those that
  /// look where the ray goes. In other arrays a ray crosses a cell from either side.
  bool outwards = false;
};

/// Returns the Delaunay triangulation of the centres projected onto their best-fit plane.
/// Predicates are exact (centres snapped to 2^-26 of the extent), so co-circular centres, as in a
/// regular grid, give one deterministic triangulation. Centres closer than 1e-9 of the extent (or
/// coincident) are merged into the first. Centres are collinear if all are closer than 1e-7 of the
/// extent to a line, or if they scatter about it by less than 0.1 of the smallest spacing of their
/// stations (camera_stations.h), which count once in a row.
/// `viewing_directions`: unit, world, one per centre. Throws Error (bad input) for no centre.
Topology delaunay_topology(std::span<const Eigen::Vector3d> centres,
                           std::span<const Eigen::Vector3d> viewing_directions);

/// Returns the topology of a grid: each cell of four neighbours is split along its shorter diagonal
/// (ties: from lower row and column to higher). `rows` and `columns` give each centre's grid
/// position. Holes from missing positions are closed by Delaunay triangulation. Falls back to
/// delaunay_topology() if positions repeat or the grid is a line.
Topology grid_topology(std::span<const Eigen::Vector3d> centres,
                       std::span<const Eigen::Vector3d> viewing_directions,
                       std::span<const int> rows, std::span<const int> columns);

}  // namespace raystage::rig
