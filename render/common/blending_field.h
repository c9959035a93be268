// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "render/common/light_field_frame.h"
#include "render/common/view.h"

namespace raystage {

/// Inverse planar depths along a view's axis, evenly spaced: the planes that are tried.
struct SweepPlanes {
  int count = 1;
  double farthest = 0;  ///< 1/m, of plane 0
  double step = 0;      ///< 1/m
  double inverse_depth(double plane) const { return farthest + plane * step; }
  /// The same, told from plane 0.
  SweepPlanes from_farthest() const { return {count, 0, step}; }
  double nearest() const { return inverse_depth(count - 1); }
};

/// A stretch of inverse depths, 1/m.
struct InverseDepthRange {
  double farthest = 0, nearest = 0;
  /// Nothing at all; as inverse_depth_range_in_view() says it.
  bool empty() const { return !(farthest <= nearest); }
};
/// A view's rays, through its lens: what the slow rendering of any view and the planning share.
class ViewRays {
 public:
  explicit ViewRays(const VirtualCamera& view);
  /// In the world, scaled to planar depth 1; nullopt where no ray reaches the pixel.
  std::optional<Eigen::Vector3d> through(double x, double y) const;
  /// Of pixels all over the view whose rays bound all others': the corners, unless the lens bends
  /// them.
  std::vector<Eigen::Vector3d> bounding_rays() const;

 private:
  const VirtualCamera& view_;
  CameraModel model_;
};

/// A camera and its share of a ray.
struct CameraWeight {
  int camera = 0;
  double share = 0;
};

/// Which cameras a view's rays are reconstructed from: the best few at the corners of tiles, with
/// weights that fall to 0 before a camera leaves the choice (after Buehler et al. 2001 and eq. 2.3
/// of the thesis, but with no penalty for resolution: README.md), and linear between corners: so
/// nothing jumps, neither from pixel to pixel nor from view to view. A tile none of whose corners
/// any camera sees has the choice of its middle: the one that is wider than all that the cameras
/// see.
class BlendingField {
 public:
  static constexpr int kTile = 32;  ///< pixels

  /// `members`: cameras to choose from. At a corner the penalty of a camera is the angle between
  /// its ray and the view's to the point mid-way in `range`, divided by how well it sees the ray's
  /// stretch (1 in the inner part of its frame, falling to 0 at the border; the mean over the
  /// stretch). The `count` of least penalty count, with weights (1 - p / p_next) / p.
  BlendingField(const VirtualCamera& view, const Rig& rig, std::vector<int> members,
                const InverseDepthRange& range, int count);

  /// A camera within a tile: its share at the tile's upper left, upper right, lower left and lower
  /// right corner. Shares sum to 1 at a corner, or are 0 where no camera sees.
  struct TileCamera {
    int camera = 0;
    std::array<float, 4> share{};
  };
  struct Tile {
    int left = 0, right = 0, top = 0, bottom = 0;  ///< pixels of the view
    std::vector<TileCamera> cameras;               ///< by index in the rig
    bool is_chosen_at_centre = false;              ///< chosen there, not at the corners
    /// Cameras whose share is greatest in the tile's middle, `count` at most, by index in the rig.
    std::vector<int> best;
  };
  int columns() const { return columns_; }
  int rows() const { return rows_; }
  const Tile& tile(int column, int row) const {
    return tiles_[static_cast<std::size_t>(row * columns_ + column)];
  }
  /// A camera's share at the pixel's centre, by the tile that the pixel lies in.
  static float share(const Tile& tile, const TileCamera& camera, int x, int y);
  /// The same for the tile's pixels of row y, from its left on.
  static void weights(const Tile& tile, const TileCamera& camera, int y, std::span<float> of_row);
  const std::vector<CameraWeight>& corner(int column, int row) const {
    return corners_[static_cast<std::size_t>(row * (columns_ + 1) + column)];
  }

 private:
  int columns_ = 0, rows_ = 0;
  std::vector<std::vector<CameraWeight>> corners_;
  std::vector<Tile> tiles_;
};

/// Inverse depths at which a view can see things that lie between `near` and `far` metres in front
/// of the array (far may be infinite); nothing nearer to the eye than a quarter of `near` is looked
/// for. Empty where the view sees nothing of that.
InverseDepthRange inverse_depth_range_in_view(const VirtualCamera& view, const Rig& rig,
                                              DepthRange scene);

/// How many planes across the range lie so close that from one to the next a point moves by no more
/// than `step_px` pixels between neighbours among the cameras that `field` chose (eq. 2.1): a whole
/// number, however large. One where the range is a point, or no two cameras see the same.
double required_plane_count(const InverseDepthRange& range, const VirtualCamera& view,
                            const Rig& rig, const BlendingField& field, double step_px);
/// Such a number for people, so coarsely that it is the same for all of a shot: the next multiple
/// of half its power of ten.
double rounded_for_display(double planes);
/// `count` planes across the range; one, in its middle, if count is 1.
SweepPlanes evenly_spaced_planes(const InverseDepthRange& range, int count);

}  // namespace raystage
