// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "render/depth/inverse_depth_map.h"

namespace raystage {

inline constexpr int kDepthTileLog2 = 5, kDepthTile = 1 << kDepthTileLog2;  ///< pixels a side

/// Inverse depths of a view's pixels, in tiles, row by row; only of tiles that are wanted.
/// kUnknownDepth where nothing is known, and in a tile's part beyond the view.
struct DepthTiles {
  /// By tile, row by row: of its first value; 0: not wanted.
  std::vector<std::int32_t> first;
  /// The first kDepthTile x kDepthTile are of no tile.
  std::vector<float> values;

  bool wanted(std::size_t tile) const { return first[tile] > 0; }
  const float* row(std::size_t tile, int y) const {
    return values.data() + first[tile] + static_cast<std::ptrdiff_t>(y) * kDepthTile;
  }
};
int depth_tile_columns(const VirtualCamera& view);
std::size_t depth_tile_count(const VirtualCamera& view);

/// Returns a camera's depths warped into `view`: each pixel is splatted over the pixels that it
/// covers there (kMaxSplatSize a side at most); the nearest depth wins. `wanted`: by tile, 0 or
/// not. `nearest`: block_nearest_depths() of the map; where given, what cannot come down in a
/// wanted tile is not looked at. Run-time dispatch.
DepthTiles warp_depths(const InverseDepthMap& map, const VirtualCamera& camera,
                       const VirtualCamera& view, std::span<const std::uint8_t> wanted,
                       const InverseDepthMap* nearest = nullptr);
inline constexpr int kMaxSplatSize = 8;
/// A point with at most this footprint is splatted on one pixel: few holes remain.
inline constexpr float kSinglePixelFootprint = 1.25F;

/// The reference of warp_depths(), for the whole view.
InverseDepthMap warp_depths_reference(const InverseDepthMap& map, const VirtualCamera& camera,
                                      const VirtualCamera& view);

}  // namespace raystage
