// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "render/slabs/slab.h"

namespace raystage::render {

/// Computes where the rays of a virtual camera cross a slab's camera plane.
///
/// With the virtual camera at e and the ray d in the slab's frame (camera plane z = 0), the
/// crossing is e - d e_z / d_z. In units of nodes, column = column_numerator / across with
///   across = -d_z,  column_numerator = (e_x across + e_z d_x) / spacing,
/// which is linear in the pixel. It is exact with the virtual camera on the plane, where e_z is 0.
/// Rays are whole lines: a camera plane behind the virtual camera counts too.
class SlabRays {
 public:
  /// Pixels [begin, end) of a row whose centres cross the cell between the nodes at (column, row)
  /// and (column + 1, row + 1).
  struct Run {
    int begin = 0, end = 0, column = 0, row = 0;
  };
  struct Crossing {
    double column = 0, row = 0;  ///< in nodes, within the grid
  };

  /// Computes the functions of the rays of `view` without its distortion.
  SlabRays(const VirtualCamera& view, const Slab& slab);

  /// Return linear functions of (x, y, 1), x and y in pixels of the view; 0 along an axis with one
  /// node. A single line of cameras acts as an endless strip; a single camera is used for every
  /// ray.
  const Eigen::Vector3d& column_numerator() const { return column_times_; }
  const Eigen::Vector3d& row_numerator() const { return row_times_; }
  const Eigen::Vector3d& across() const { return across_; }

  /// Computes the row's pixels by cell, in increasing order on either side of the camera plane.
  /// Pixels that miss the grid or belong to another slab are omitted.
  void runs_of_row(int y, int width, std::vector<Run>& runs) const;

  /// Returns whether the ray through (x, y) belongs to the slab: it crosses the grid, in front of
  /// or behind the virtual camera.
  bool contains_ray(double x, double y) const;
  /// Returns the crossing of a ray for which contains_ray() is true.
  Crossing crossing(double x, double y) const;

 private:
  using Conditions = std::vector<Eigen::Vector3d>;
  void add_runs(const Conditions& conditions, int y, int width, std::vector<Run>& runs) const;

  int columns_, rows_;
  Eigen::Vector3d column_times_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d row_times_ = Eigen::Vector3d::Zero();
  Eigen::Vector3d across_;
  /// The ray belongs to the slab where all functions of one of these are at least 0: one per side
  /// of the camera plane.
  std::vector<Conditions> sides_;
};

}  // namespace raystage::render
