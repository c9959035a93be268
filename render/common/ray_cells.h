// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "render/common/view.h"
#include "rig/rig.h"

namespace raystage {

/// The cells of the array's topology as a virtual camera sees them (thesis 4.1.2): between which
/// cameras a ray passes, and how near to each.
///
/// A ray from O along d passes between the cameras at C1, C2, C3 with barycentric weights
///   w1 : w2 : w3 = d.((C2-O)x(C3-O)) : d.((C3-O)x(C1-O)) : d.((C1-O)x(C2-O)),
/// whose sum is d.((C2-C1)x(C3-C1)). As d is linear in the pixel, each is a linear function of the
/// pixel: exact on the array plane, in front of it and behind it alike, without a division by the
/// distance to the plane. Rays are whole lines: an array behind the virtual camera counts too.
class RayCells {
 public:
  struct Cell {
    int count = 0;                ///< cameras in use: 1 to 3
    std::array<int, 3> camera{};  ///< indices into the rig
    /// weight i = share[i].(x, y, 1) / total.(x, y, 1), x and y in pixels of the view; 0 where no
    /// pixel has more of the camera than rounding leaves.
    std::array<Eigen::Vector3d, 3> share;
    Eigen::Vector3d total = Eigen::Vector3d::Zero();
    /// e2.e2, e2.e3, e3.e3 of the edges from its first camera to its second and third, m^2: with
    /// the weights they tell which camera is nearest.
    std::array<double, 3> edge_products{};
    /// How far outside, in units of the weight, a ray still counts as in the cell.
    double edge_tolerance = 0;
    double first_row = 0, last_row = 0;  ///< pixel rows outside of which no ray passes
  };
  struct Crossing {
    int cell = 0;
    std::array<double, 3> weight{};  ///< in [0, 1], sum 1; the unused ones are 0
  };
  /// Pixels [begin, end) of a row whose centres pass through one cell, from one side of it: total
  /// has one sign.
  struct Span {
    int begin = 0, end = 0, cell = 0;
  };

  /// `view` without its distortion; `topology` over cameras of `rig`.
  RayCells(const VirtualCamera& view, const Rig& rig, const Topology& topology);

  const std::vector<Cell>& cells() const { return cells_; }

  /// The crossing of the ray through an (undistorted) pixel position. Where the array is folded
  /// over itself the cell of lowest index counts. nullopt where the ray passes the array by.
  std::optional<Crossing> locate(double x, double y) const;

  /// Weights of the ray through (x, y) in a cell that it is known to cross.
  Crossing crossing_in_cell(int cell, double x, double y) const;

  /// The same ray given whole to the camera nearest to where it crosses the cell; the first at a
  /// tie.
  Crossing nearest(const Crossing& crossing) const;

  /// The row's pixels by cell, from left to right; pixels that pass the array by are left out.
  /// Agrees with locate() at every pixel centre. `scratch` is reused between rows.
  void row_spans(int y, int width, std::vector<int>& scratch, std::vector<Span>& spans) const;

 private:
  std::vector<Cell> cells_;
};

/// World direction (not unit) of the ray through pixel (x, y), undistorted: matrix * (x, y, 1).
Eigen::Matrix3d world_ray_from_pixel(const VirtualCamera& view);

}  // namespace raystage
