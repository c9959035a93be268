// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <vector>

#include "rig/planning/direction_polygon.h"
#include "rig/rig.h"
#include "rig/topology.h"

namespace raystage::rig {

/// A set of directions: those within planes, n.d >= 0, but for those of its pockets.
struct DirectionSet {
  std::vector<Eigen::Vector3d> hull;
  std::vector<DirectionSet> pockets;
};

/// Directions in parts that do not overlap.
struct DividedDirections {
  std::vector<DirectionPolygon> recorded, unrecorded;
};

/// The rays that a real array recorded, as far as the horizon: those that pass between neighbouring
/// cameras of which at least one looks there (thesis 4.1.2). Cameras may be toed in, out of the
/// plane and distorted.
class RecordedCells {
 public:
  /// No rays.
  RecordedCells() = default;
  /// `topology`: of the cameras of `rig`; rows and single positions have no cells.
  RecordedCells(const Rig& rig, const Topology& topology);

  bool is_empty() const { return cells_.empty(); }
  /// Divides directions from a position in the world into those in which a ray was recorded and the
  /// others. The borders of distorted pictures are met within 0.02 pixels.
  DividedDirections divide(const Eigen::Vector3d& position,
                           std::vector<DirectionPolygon> directions) const;

 private:
  std::vector<Eigen::Vector3d> centres_;
  std::vector<std::optional<DirectionSet>> frusta_;  // that each camera sees; nullopt: nothing
  std::vector<Topology::Cell> cells_;
};

}  // namespace raystage::rig
