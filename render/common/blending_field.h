// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <optional>
#include <span>
#include <vector>

#include "render/common/light_field_frame.h"
#include "render/common/view.h"

namespace raystage::render {

/// Evenly spaced inverse planar depths along a view's axis: the planes of a sweep.
struct SweepPlanes {
  int count = 1;
  double farthest = 0;  ///< 1/m, of plane 0
  double step = 0;      ///< 1/m
  double inverse_depth(double plane) const { return farthest + plane * step; }
  /// Returns the same planes relative to plane 0.
  SweepPlanes from_farthest() const { return {count, 0, step}; }
  double nearest() const { return inverse_depth(count - 1); }
};

/// A range of inverse depths, 1/m.
struct InverseDepthRange {
  double farthest = 0, nearest = 0;
  /// Returns whether the range is empty, as inverse_depth_range_in_view() returns it where nothing
  /// is visible.
  bool empty() const { return !(farthest <= nearest); }
};
/// The rays of a view, lens distortion included. The per-ray references and the planning use it.
class ViewRays {
 public:
  explicit ViewRays(const VirtualCamera& view);
  /// Returns the ray in the world, scaled to planar depth 1, or nullopt where no ray reaches the
  /// pixel.
  std::optional<Eigen::Vector3d> through(double x, double y) const;
  /// Returns rays of pixels that bound all rays of the view: those of the corners, or of pixels all
  /// over the view if the lens distorts.
  std::vector<Eigen::Vector3d> bounding_rays() const;

 private:
  const VirtualCamera& view_;
  rig::CameraModel model_;
};

/// A camera and its blending weight for a ray.
struct CameraWeight {
  int camera = 0;
  double share = 0;
};

/// The cameras from which a view's rays are reconstructed: the best few at each corner of a grid of
/// tiles. Their weights fall to 0 before a camera is no longer chosen (after Buehler et al. 2001
/// and thesis eq. 2.3, without their resolution penalty: README.md). Weights are linear between
/// corners, so that they are continuous across pixels and across views. If no camera sees any
/// corner of a tile, the choice at the tile's centre applies; such a tile is wider than all that
/// the cameras see.
class BlendingField {
 public:
  static constexpr int kTile = 32;  ///< pixels

  /// Computes the weights. `members`: the cameras to choose from. The penalty p of a camera at a
  /// corner is an angle divided by the camera's visibility of the ray. The angle is between its ray
  /// and the view's ray to the midpoint of `range`. The visibility is the mean within `range`: 1 in
  /// the inner part of the camera's frame, falling to 0 at the border. The `count` cameras with the
  /// smallest penalties are used, with weights (1 - p / p_next) / p.
  BlendingField(const VirtualCamera& view, const rig::Rig& rig, std::vector<int> members,
                const InverseDepthRange& range, int count);

  /// Returns the field of all cameras of a light field frame, as if none were absent; nullopt if
  /// none is.
  static std::optional<BlendingField> complete(const VirtualCamera& view,
                                               const LightFieldFrame& instant,
                                               const InverseDepthRange& range, int count);

  /// A camera of a tile and its weights at the upper left, upper right, lower left and lower right
  /// corner. The weights of all cameras sum to 1 at a corner, or are 0 where no camera sees it.
  struct TileCamera {
    int camera = 0;
    std::array<float, 4> share{};
  };
  struct Tile {
    int left = 0, right = 0, top = 0, bottom = 0;  ///< pixels of the view
    std::vector<TileCamera> cameras;               ///< by index in the rig
    bool is_chosen_at_centre = false;  ///< chosen at the tile's centre instead of its corners
    /// Cameras with the largest weights at the tile's centre, at most `count`, by index in the rig.
    std::vector<int> best;
  };
  int columns() const { return columns_; }
  int rows() const { return rows_; }
  const Tile& tile(int column, int row) const { return tiles_[row * columns_ + column]; }
  /// Returns a camera's weight at a pixel's centre, from the tile that contains the pixel.
  static float share(const Tile& tile, const TileCamera& camera, int x, int y);
  /// Writes the weights of the tile's pixels in row y, from the left edge of the tile.
  static void weights(const Tile& tile, const TileCamera& camera, int y, std::span<float> of_row);
  /// Returns the tile that contains a pixel.
  const Tile& tile_at(int x, int y) const { return tile(x / kTile, y / kTile); }
  const std::vector<Tile>& tiles() const { return tiles_; }  ///< row by row
  const std::vector<CameraWeight>& corner(int column, int row) const {
    return corners_[row * (columns_ + 1) + column];
  }

 private:
  int columns_ = 0, rows_ = 0;
  std::vector<std::vector<CameraWeight>> corners_;
  std::vector<Tile> tiles_;
};

/// Returns the weight of the absent cameras at a pixel, 0 to 1. `complete`: as
/// BlendingField::complete() returns it.
float absent_camera_weight(const std::optional<BlendingField>& complete,
                           const LightFieldFrame& instant, int x, int y);

/// Returns the inverse depths at which a view can show objects between `near` and `far` metres in
/// front of the array (far may be infinite), or from its centre if it looks around. Objects closer
/// to the virtual camera than a quarter of `near` are ignored. The range is empty where the view
/// shows none of that.
InverseDepthRange inverse_depth_range_in_view(const VirtualCamera& view, const rig::Rig& rig,
                                              schemas::DepthRange scene);

/// Returns the number of planes needed across the range. From plane to plane, a point then moves by
/// at most `step_px` pixels between neighbouring cameras of `field` (eq. 2.1), at different
/// stations (rig/camera_stations.h) if there are any. The result is an integer of any size: 1 where
/// the range is a point or no two cameras see the same rays.
double required_plane_count(const InverseDepthRange& range, const VirtualCamera& view,
                            const rig::Rig& rig, const BlendingField& field, double step_px);
/// Returns a plane count rounded for display, so coarsely that it is the same throughout a shot:
/// the next multiple of half its power of ten.
double rounded_for_display(double planes);
/// Returns `count` planes across the range; a count of 1 gives the plane in the middle of the
/// range.
SweepPlanes evenly_spaced_planes(const InverseDepthRange& range, int count);

}  // namespace raystage::render
