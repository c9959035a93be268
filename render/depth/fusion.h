// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <limits>
#include <span>
#include <string>
#include <vector>

#include "render/depth/inverse_depth_map.h"
#include "render/depth/warp.h"

namespace raystage::render {

/// The depths that one camera proposes, and their weights.
struct DepthHypotheses {
  const InverseDepthMap* map = nullptr;
  const VirtualCamera* camera = nullptr;
  /// By tile of the view (DepthTiles): non-negative weights at its upper left, upper right, lower
  /// left and lower right corner; linear in between.
  std::vector<std::array<float, 4>> weights;
  const InverseDepthMap* nearest = nullptr;  ///< block_nearest_depths() of the map; may be null
};
/// Returns the same weight for all tiles of a view.
std::vector<std::array<float, 4>> uniform_weights(const VirtualCamera& view, float weight);

struct FusionOptions {
  float tolerance = 0;    ///< 1/m, above 0: see VoteRun
  float min_support = 0;  ///< smallest share of the weights that must support a depth, 0 to 1
  /// 1/m; see median_row(). Infinite: lines one pixel wide are removed as outliers.
  float line_tolerance = std::numeric_limits<float>::infinity();
  /// Limits how many rows of tiles are warped at a time; at least one.
  std::size_t working_bytes = std::numeric_limits<std::size_t>::max();
  bool is_valid(std::string* reason) const;
};
/// Returns a view's depths: the hypothesis with the largest support (vote(); at most kMaxHypotheses
/// per tile). If that support is below `min_support`, the pixel takes the farthest of the depths
/// next in the row and column, as cameras miss the background. Then a 3x3 median is applied that
/// can keep lines. Pixels without a near depth stay kUnknownDepth.
InverseDepthMap fuse_hypotheses(const VirtualCamera& view,
                                std::span<const DepthHypotheses> hypotheses,
                                const FusionOptions& options);
/// Returns the depths of one hypothesis warped into the view, for tiles in which it has a weight.
DepthTiles warp_hypotheses(const VirtualCamera& view, const DepthHypotheses& hypothesis);
/// Returns fuse_hypotheses() of warped hypotheses, the whole view at once; reads no maps.
InverseDepthMap fuse_warped_hypotheses(const VirtualCamera& view,
                                       std::span<const DepthHypotheses> hypotheses,
                                       std::span<const DepthTiles> warped,
                                       const FusionOptions& options);
/// Returns the working memory of fuse_hypotheses(): 8 bytes per pixel, and per hypothesis with a
/// weight 4 bytes per pixel of the current rows of tiles. It is at least 16 bytes per pixel in
/// total, and at most `working_bytes` if that suffices.
std::size_t fusion_bytes(const VirtualCamera& view, std::span<const DepthHypotheses> hypotheses,
                         std::size_t working_bytes);

/// Similarity of each pixel to its left and upper neighbour, 0 to 1.
struct EdgeWeights {
  std::vector<float> left, above;
};
/// Applies a recursive edge-aware filter (Gastal and Oliveira 2011) in place: along rows, then
/// along columns, forth and back. Each value moves towards its neighbour's by their edge weight.
/// `channels`: values per pixel.
void domain_transform_filter(std::vector<float>& values, int channels, int width, int height,
                             const EdgeWeights& links);

/// Compute the same in double for any number of hypotheses: the references.
InverseDepthMap fuse_hypotheses_reference(const VirtualCamera& view,
                                          std::span<const DepthHypotheses> hypotheses,
                                          const FusionOptions& options);
void domain_transform_filter_reference(std::vector<float>& values, int channels, int width,
                                       int height, const EdgeWeights& links);

}  // namespace raystage::render
