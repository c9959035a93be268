// SPDX-License-Identifier: Apache-2.0
// Fuses the depth hypotheses of several cameras into one inverse depth map of a view. Each camera's
// map is warped to the view (warp.cpp), and each pixel takes the hypothesis with the largest
// weighted support of the others (vote() in estimation_kernels.cpp). Unknown pixels take the
// farther of their known neighbours in row and column, and a 3x3 median removes outliers.
// domain_transform_filter() is the recursive edge-aware filter of Gastal and Oliveira, "Domain
// transform for edge-aware image and video processing", SIGGRAPH 2011. Input and output: inverse
// planar depths, 1/m, row-major. Cost: O(pixels x hypotheses) for warping, O(pixels x hypotheses^2)
// for the vote within tiles of 32 x 32 pixels. Reference: fusion_reference.cpp.
#include "render/depth/fusion.h"

#include <algorithm>
#include <array>

#include "base/options.h"
#include "base/parallel.h"
#include "render/depth/estimation_kernels.h"
#include "render/depth/warp.h"

namespace raystage::render {
namespace {

std::size_t view_pixel_count(const VirtualCamera& view) {
  return static_cast<std::size_t>(view.width) * view.height;
}

/// Returns the farthest of the known depths next along the row and the column, or unknown.
float depth_behind(const InverseDepthMap& map, const std::vector<float>& support, float min_support,
                   int x, int y) {
  constexpr int kReach = 40;  // pixels
  constexpr std::array<std::array<int, 2>, 4> kWays{{{1, 0}, {-1, 0}, {0, 1}, {0, -1}}};
  float behind = kUnknownDepth;
  for (const auto& [dx, dy] : kWays) {
    for (int i = 1; i <= kReach; ++i) {
      const int column = x + i * dx, row = y + i * dy;
      if (!map.contains(column, row)) break;
      const std::size_t at = map.offset(column, row);
      if (map.values[at] < 0 || support[at] < min_support) continue;
      behind = behind < 0 ? map.values[at] : std::min(behind, map.values[at]);
      break;
    }
  }
  return behind;
}

InverseDepthMap filled(const InverseDepthMap& map, const std::vector<float>& support,
                       float min_support) {
  InverseDepthMap result = map;
  raystage::parallel_for(0, map.height, [&](int y) {
    for (int x = 0; x < map.width; ++x) {
      const std::size_t at = map.offset(x, y);
      if (map.values[at] >= 0 && support[at] >= min_support) continue;
      const float behind = depth_behind(map, support, min_support, x, y);
      if (behind >= 0) result.values[at] = behind;
    }
  });
  return result;
}

InverseDepthMap median(const InverseDepthMap& map, float line_tolerance) {
  InverseDepthMap result = map;
  raystage::parallel_for(0, map.height, [&](int y) {
    const auto row = [&](int at) { return map.row(std::clamp(at, 0, map.height - 1)).data(); };
    median_row({row(y - 1), row(y), row(y + 1)}, line_tolerance, result.row(y));
  });
  return result;
}

using CornerWeights = std::array<float, 4>;

bool counts(const CornerWeights& weights) {
  return std::ranges::any_of(weights, [](float weight) { return weight > 0; });
}

/// Interpolates the weights along row `y` of a tile of `width` x `height` pixels.
void weigh_row(const CornerWeights& corners, int y, int width, int height,
               std::array<float, kDepthTile>& weights) {
  const float down = (static_cast<float>(y) + 0.5F) / static_cast<float>(height);
  const float left = corners[0] + down * (corners[2] - corners[0]);
  const float right = corners[1] + down * (corners[3] - corners[1]);
  for (int x = 0; x < kDepthTile; ++x) {
    const float across = (static_cast<float>(x) + 0.5F) / static_cast<float>(width);
    weights[x] = left + across * (right - left);
  }
}

void vote_in_tile(const VirtualCamera& view, std::span<const DepthHypotheses> hypotheses,
                  std::span<const DepthTiles> warped, std::size_t tile, float tolerance,
                  InverseDepthMap& fused, std::vector<float>& support) {
  static_assert(kDepthTile <= kMaxVotePixels);
  const int columns = depth_tile_columns(view);
  const int left = static_cast<int>(tile) % columns * kDepthTile;
  const int top = static_cast<int>(tile) / columns * kDepthTile;
  const int width = std::min(kDepthTile, view.width - left);
  const int height = std::min(kDepthTile, view.height - top);
  std::vector<std::size_t> members;
  for (std::size_t i = 0; i < hypotheses.size() && members.size() < kMaxHypotheses; ++i) {
    if (warped[i].wanted(tile)) members.push_back(i);
  }
  std::array<std::array<float, kDepthTile>, kMaxHypotheses> weights;
  std::array<const float*, kMaxHypotheses> depth_of, weight_of;
  std::array<float, kMaxVotePixels> depth, agreeing;
  for (int y = 0; y < height; ++y) {
    for (std::size_t i = 0; i < members.size(); ++i) {
      depth_of[i] = warped[members[i]].row(tile, y);
      weigh_row(hypotheses[members[i]].weights[tile], y, width, height, weights[i]);
      weight_of[i] = weights[i].data();
    }
    vote({std::span(depth_of).first(members.size()), std::span(weight_of).first(members.size()),
          width, tolerance, depth.data(), agreeing.data()});
    const std::ptrdiff_t at = static_cast<std::ptrdiff_t>(top + y) * view.width + left;
    std::copy_n(depth.begin(), width, fused.values.begin() + at);
    std::copy_n(agreeing.begin(), width, support.begin() + at);
  }
}

/// Rows of tiles that are warped and voted on at a time.
struct TileBand {
  int first = 0, end = 0;
  std::size_t bytes = 0;  ///< of the warped depths
};

/// Returns bands of as many rows as fit `room`, at least one each.
std::vector<TileBand> bands_within(const VirtualCamera& view,
                                   std::span<const DepthHypotheses> hypotheses, std::size_t room) {
  constexpr std::size_t kTileBytes = sizeof(float) * kDepthTile * kDepthTile;
  const auto columns = static_cast<std::size_t>(depth_tile_columns(view));
  const std::size_t tiles = depth_tile_count(view);
  // Per hypothesis: the table of its tiles, and the empty tile.
  const std::size_t tables = hypotheses.size() * (sizeof(std::int32_t) * tiles + kTileBytes);
  std::vector<TileBand> bands;
  for (std::size_t row = 0; row < tiles / columns; ++row) {
    std::size_t bytes = 0;
    for (const DepthHypotheses& hypothesis : hypotheses) {
      const auto of_row = std::span(hypothesis.weights).subspan(row * columns, columns);
      bytes += kTileBytes * static_cast<std::size_t>(std::ranges::count_if(of_row, counts));
    }
    const int at = static_cast<int>(row);
    if (bands.empty() || bands.back().bytes + bytes > room) bands.push_back({at, at, tables});
    bands.back().end = at + 1;
    bands.back().bytes += bytes;
  }
  return bands;
}

/// Returns the bytes in addition to the warped depths: fused depths and their support.
std::size_t fused_bytes(const VirtualCamera& view) {
  return 2 * sizeof(float) * view_pixel_count(view);
}

std::vector<TileBand> bands_of(const VirtualCamera& view,
                               std::span<const DepthHypotheses> hypotheses,
                               std::size_t working_bytes) {
  return bands_within(view, hypotheses, working_bytes - std::min(working_bytes, fused_bytes(view)));
}

}  // namespace

std::vector<std::array<float, 4>> uniform_weights(const VirtualCamera& view, float weight) {
  std::vector<CornerWeights> weights(depth_tile_count(view));
  for (CornerWeights& tile : weights) tile.fill(weight);
  return weights;
}

std::size_t fusion_bytes(const VirtualCamera& view, std::span<const DepthHypotheses> hypotheses,
                         std::size_t working_bytes) {
  std::size_t most = fused_bytes(view);  // filled and smoothed depths need as much again
  for (const TileBand& band : bands_of(view, hypotheses, working_bytes)) {
    most = std::max(most, band.bytes);
  }
  return fused_bytes(view) + most;
}

namespace {

DepthTiles warp_tiles(const VirtualCamera& view, const DepthHypotheses& hypothesis,
                      std::size_t first, std::size_t end) {
  std::vector<std::uint8_t> wanted(depth_tile_count(view));
  for (std::size_t tile = first; tile < end; ++tile) {
    wanted[tile] = counts(hypothesis.weights[tile]) ? 1 : 0;
  }
  return warp_depths(*hypothesis.map, *hypothesis.camera, view, wanted, hypothesis.nearest);
}

}  // namespace

DepthTiles warp_hypotheses(const VirtualCamera& view, const DepthHypotheses& hypothesis) {
  return warp_tiles(view, hypothesis, 0, depth_tile_count(view));
}

bool FusionOptions::is_valid(std::string* reason) const {
  return is_within("tolerance (1/m)", tolerance, 1e-12, 1e12, reason) &&
         is_within("smallest support", min_support, 0, 1, reason);
}

InverseDepthMap fuse_warped_hypotheses(const VirtualCamera& view,
                                       std::span<const DepthHypotheses> hypotheses,
                                       std::span<const DepthTiles> warped,
                                       const FusionOptions& options) {
  require_valid(options, "fusion of depth hypotheses");
  InverseDepthMap fused(view.width, view.height);
  std::vector<float> support(fused.values.size());
  raystage::parallel_for(std::size_t{0}, depth_tile_count(view), [&](std::size_t tile) {
    vote_in_tile(view, hypotheses, warped, tile, options.tolerance, fused, support);
  });
  return median(filled(fused, support, options.min_support), options.line_tolerance);
}

InverseDepthMap fuse_hypotheses(const VirtualCamera& view,
                                std::span<const DepthHypotheses> hypotheses,
                                const FusionOptions& options) {
  require_valid(options, "fusion of depth hypotheses");
  const auto columns = static_cast<std::size_t>(depth_tile_columns(view));
  InverseDepthMap fused(view.width, view.height);
  std::vector<float> support(fused.values.size());
  for (const TileBand& band : bands_of(view, hypotheses, options.working_bytes)) {
    const std::size_t first = static_cast<std::size_t>(band.first) * columns;
    const std::size_t end = static_cast<std::size_t>(band.end) * columns;
    std::vector<DepthTiles> warped(hypotheses.size());
    raystage::parallel_for(std::size_t{0}, hypotheses.size(), [&](std::size_t i) {
      warped[i] = warp_tiles(view, hypotheses[i], first, end);
    });
    raystage::parallel_for(first, end, [&](std::size_t tile) {
      vote_in_tile(view, hypotheses, warped, tile, options.tolerance, fused, support);
    });
  }
  return median(filled(fused, support, options.min_support), options.line_tolerance);
}

void domain_transform_filter(std::vector<float>& values, int channels, int width, int height,
                             const EdgeWeights& links) {
  const auto n = static_cast<std::ptrdiff_t>(channels);
  const std::ptrdiff_t pitch = n * width;
  const auto draw = [n](float* value, const float* towards, float link) {
    for (std::ptrdiff_t c = 0; c < n; ++c) value[c] += link * (towards[c] - value[c]);
  };
  raystage::parallel_for(0, height, [&](int y) {
    float* row = values.data() + y * pitch;
    const float* left = links.left.data() + static_cast<std::ptrdiff_t>(y) * width;
    for (int x = 1; x < width; ++x) draw(row + x * n, row + (x - 1) * n, left[x]);
    for (int x = width - 2; x >= 0; --x) draw(row + x * n, row + (x + 1) * n, left[x + 1]);
  });
  constexpr int kColumns = 64;
  raystage::parallel_for(0, (width + kColumns - 1) / kColumns, [&](int strip) {
    const int begin = strip * kColumns, end = std::min(width, begin + kColumns);
    const auto draw_row = [&](int y, int towards, const float* above) {
      for (int x = begin; x < end; ++x) {
        draw(values.data() + y * pitch + x * n, values.data() + towards * pitch + x * n, above[x]);
      }
    };
    const auto link_row = [&](int y) {
      return links.above.data() + static_cast<std::ptrdiff_t>(y) * width;
    };
    for (int y = 1; y < height; ++y) draw_row(y, y - 1, link_row(y));
    for (int y = height - 2; y >= 0; --y) draw_row(y, y + 1, link_row(y + 1));
  });
}

}  // namespace raystage::render
