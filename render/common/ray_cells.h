// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "render/common/view.h"
#include "rig/rig.h"

namespace raystage::render {

/// The cells of the array's topology as seen by a virtual camera (thesis 4.1.2). Determines between
/// which cameras a ray passes, and their weights.
///
/// A ray from O along d passes between the cameras at C1, C2, C3 with barycentric weights
///   w1 : w2 : w3 = d.((C2-O)x(C3-O)) : d.((C3-O)x(C1-O)) : d.((C1-O)x(C2-O)),
/// whose sum is d.((C2-C1)x(C3-C1)). As d is linear in the pixel, each weight is a linear function
/// of the pixel. It is exact on the array plane, in front of it and behind it alike, without a
/// division by the distance to the plane. Rays are whole lines: an array behind the virtual camera
/// counts too. Of an array that looks outwards, only the cell that the line leaves counts: there
/// the sum of the weights is positive.
class RayCells {
 public:
  struct Cell {
    int count = 0;                ///< cameras in use: 1 to 3
    std::array<int, 3> camera{};  ///< indices into the rig
    /// weight i = share[i].(x, y, 1) / total.(x, y, 1), x and y in pixels of the view; 0 where
    /// the camera's weight is below rounding in all pixels.
    std::array<Eigen::Vector3d, 3> share;
    Eigen::Vector3d total = Eigen::Vector3d::Zero();
    /// e2.e2, e2.e3, e3.e3 of the edges from the first camera to the second and third, m^2. With
    /// the weights they determine the nearest camera.
    std::array<double, 3> edge_products{};
    /// How far outside the cell, in units of the weight, a ray still counts as inside.
    double edge_tolerance = 0;
    double first_row = 0, last_row = 0;  ///< pixel rows outside of which no ray passes
    bool only_leaving = false;           ///< rays count where total is positive: Topology::outwards
  };
  struct Crossing {
    int cell = 0;
    std::array<double, 3> weight{};  ///< in [0, 1], sum 1; unused ones are 0
  };
  /// Pixels [begin, end) of a row whose centres pass through one cell, from one side of it: total
  /// has one sign.
  struct Span {
    int begin = 0, end = 0, cell = 0;
  };

  /// Projects the cells of `topology`, over cameras of `rig`, into `view` without its distortion.
  RayCells(const VirtualCamera& view, const rig::Rig& rig, const rig::Topology& topology);

  const std::vector<Cell>& cells() const { return cells_; }

  /// Returns the crossing of the ray through an (undistorted) pixel position, or nullopt where the
  /// ray misses the array. Where the array folds over itself the cell of lowest index is used.
  std::optional<Crossing> locate(double x, double y) const;

  /// Returns the weights of the ray through (x, y) in a cell that the ray is known to cross.
  Crossing crossing_in_cell(int cell, double x, double y) const;

  /// Returns the crossing with all weight on the camera nearest to the point where the ray crosses
  /// the cell; the first camera at a tie.
  Crossing nearest(const Crossing& crossing) const;

  /// Computes the pixel spans of the row by cell, from left to right. Pixels whose rays miss the
  /// array are omitted. Agrees with locate() at every pixel centre. `scratch` is reused between
  /// rows.
  void row_spans(int y, int width, std::vector<int>& scratch, std::vector<Span>& spans) const;

 private:
  std::vector<Cell> cells_;
};

/// Returns the matrix M such that M (x, y, 1) is the world direction (not unit) of the ray through
/// pixel (x, y), undistorted.
Eigen::Matrix3d world_ray_from_pixel(const VirtualCamera& view);

}  // namespace raystage::render
