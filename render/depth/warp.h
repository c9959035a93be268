// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <span>
#include <vector>

#include "render/depth/inverse_depth_map.h"

namespace raystage::render {

inline constexpr int kDepthTileLog2 = 5, kDepthTile = 1 << kDepthTileLog2;  ///< pixels a side

/// Inverse depths of a view's pixels by tiles, row by row; only wanted tiles are stored.
/// kUnknownDepth if unknown, and in the part of a tile outside the view.
struct DepthTiles {
  /// By tile, row by row: index of its first value; 0: not wanted.
  std::vector<std::int32_t> first;
  std::vector<float> values;  ///< the first kDepthTile x kDepthTile belong to no tile

  bool wanted(std::size_t tile) const { return first[tile] > 0; }
  const float* row(std::size_t tile, int y) const {
    return values.data() + first[tile] + static_cast<std::ptrdiff_t>(y) * kDepthTile;
  }
};
int depth_tile_columns(const VirtualCamera& view);
std::size_t depth_tile_count(const VirtualCamera& view);

/// Returns a camera's depths warped into `view`: each pixel is splatted over the pixels that it
/// covers there (at most kMaxSplatSize a side); the nearest depth wins. `wanted`: by tile, 0 or
/// not. `nearest`: block_nearest_depths() of the map; if given, blocks that miss all wanted tiles
/// are skipped. Run-time dispatch.
DepthTiles warp_depths(const InverseDepthMap& map, const VirtualCamera& camera,
                       const VirtualCamera& view, std::span<const std::uint8_t> wanted,
                       const InverseDepthMap* nearest = nullptr);
inline constexpr int kMaxSplatSize = 8;
/// Points with at most this footprint are splatted on one pixel: few holes remain.
inline constexpr float kSinglePixelFootprint = 1.25F;

InverseDepthMap warp_depths_reference(const InverseDepthMap& map, const VirtualCamera& camera,
                                      const VirtualCamera& view);

}  // namespace raystage::render
