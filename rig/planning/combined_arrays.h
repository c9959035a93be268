// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "rig/planning/direction_polygon.h"
#include "rig/planning/range_of_motion.h"
#include "rig/planning/recorded_cells.h"
#include "rig/planning/wall_eyed_array.h"

namespace raystage::rig {

/// One of several arrays.
struct MemberArray {
  WallEyedArray rays;   ///< that it recorded; its hull has an area
  RecordedCells cells;  ///< all rays of an array that is not ideal
  /// Convex outline of its cameras in its frame and plane, counter-clockwise: what hides others.
  std::vector<Eigen::Vector2d> outline;
};

/// Several arrays that record one scene, for example the six sides of a box (thesis 6.2).
class CombinedArrays {
 public:
  /// `hide_each_other`: an array does not record a ray that passes through another one in front of
  /// it, as where all of them are there at the same time.
  CombinedArrays(std::vector<MemberArray> arrays, bool hide_each_other);

  /// Returns the share of a view's picture whose rays through a position some array recorded, 0 to
  /// 1. `view`: one eye.
  double recorded_share(const Eigen::Vector3d& position, const ViewFrustum& view) const;
  /// Returns the share of the solid angle of all rays through a position.
  double recorded_share_of_all(const Eigen::Vector3d& position) const;

  /// From where a point is seen.
  struct SeenPoint {
    double share = 0;  ///< of all directions, those in which a ray of the point was recorded
    int arrays = 0;    ///< that see it
  };
  /// Returns from where arrays see a point that is in front of them. Others may hide it.
  SeenPoint seen_point(const Eigen::Vector3d& point) const;

 private:
  /// A convex set of directions: those with n.d >= 0 for every normal.
  using Cone = std::vector<Eigen::Vector3d>;
  /// Which arrays hide a ray that passes through a position.
  enum class Hiding {
    kBeyondTheArray,    ///< those that it crosses after the one that records it
    kUntilThePosition,  ///< of these, those that it crosses before the position
  };

  std::vector<DirectionPolygon> unrecorded(const Eigen::Vector3d& position,
                                           std::vector<DirectionPolygon> directions) const;
  /// Returns what an array did not record of `directions`, in parts.
  std::vector<DirectionPolygon> unrecorded_by(std::size_t array, const Eigen::Vector3d& position,
                                              std::vector<DirectionPolygon> directions,
                                              Hiding hiding) const;
  static DividedDirections divide(const MemberArray& array, const Eigen::Vector3d& position,
                                  std::span<const DirectionPolygon> directions);
  /// Returns the directions of rays that other arrays hide.
  std::vector<Cone> hidden(std::size_t array, const Eigen::Vector3d& position, Hiding hiding) const;

  std::vector<MemberArray> arrays_;
  std::vector<std::vector<std::size_t>> hidden_by_;  // of each array: those in front of its plane
};

}  // namespace raystage::rig
