// SPDX-License-Identifier: Apache-2.0
// Corrects foreground fattening in a camera's depths. Only pixels with something farther within
// reach are looked at, and after the first round only those near corrected ones. Background and
// costs are computed by vectors of pixels (fattening_kernels.cpp). Input and output: inverse
// depths, 1/m. Cost: O(pixels near borders of surfaces x reach), and O(pixels) for the others.
// Reference: camera_depths_reference.cpp.
#include "render/depth/foreground_fattening.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <limits>
#include <utility>
#include <vector>

#include "base/parallel.h"
#include "render/depth/fattening_kernels.h"

namespace raystage::render {
namespace {

using namespace foreground_fattening;

/// Writes the minima over windows of `window` values to `to`, from each value of `from` on, `step`
/// apart; `count` of them. Doubles the window until it is reached, so that vectors take part.
/// Needs `window` - 1 more values than `count` in `from`, which it changes.
template <class Value>
void forward_minimum(Value* from, Value* to, std::ptrdiff_t step, std::ptrdiff_t count,
                     int window) {
  std::ptrdiff_t all = count + (window - 1) * step;
  int width = 1;
  for (; 2 * width <= window; width *= 2) {
    all -= width * step;
    for (std::ptrdiff_t i = 0; i < all; ++i) from[i] = std::min(from[i], from[i + width * step]);
  }
  const std::ptrdiff_t rest = (window - width) * step;
  for (std::ptrdiff_t i = 0; i < count; ++i) to[i] = std::min(from[i], from[i + rest]);
}

/// Applies a running minimum over `reach` pixels to both sides, along rows and columns.
template <class Value>
void minimum_within(std::vector<Value>& values, int width, int height, int reach) {
  constexpr Value kMost = std::numeric_limits<Value>::max();
  const int window = 2 * reach + 1;
  raystage::parallel_for(0, height, [&](int y) {
    std::vector<Value> padded(static_cast<std::size_t>(width) + 2 * reach, kMost);
    Value* row = values.data() + static_cast<std::ptrdiff_t>(y) * width;
    std::copy_n(row, width, padded.data() + reach);
    forward_minimum(padded.data(), row, 1, width, window);
  });
  constexpr int kColumns = 64;
  raystage::parallel_for(0, (width + kColumns - 1) / kColumns, [&](int strip) {
    const int first = strip * kColumns, columns = std::min(kColumns, width - first);
    const std::ptrdiff_t pitch = columns;
    std::vector<Value> padded(static_cast<std::size_t>(columns) * (height + 2 * reach), kMost);
    const auto row = [&](int y) {
      return values.data() + static_cast<std::ptrdiff_t>(y) * width + first;
    };
    for (int y = 0; y < height; ++y) {
      std::copy_n(row(y), columns, padded.data() + (y + reach) * pitch);
    }
    forward_minimum(padded.data(), padded.data(), pitch, height * pitch, window);
    for (int y = 0; y < height; ++y) std::copy_n(padded.data() + y * pitch, columns, row(y));
  });
}

class FatteningCorrection {
 public:
  FatteningCorrection(const MatchingImage& image, std::span<const NeighbourView> neighbours,
                      double per_pixel, int reach)
      : image_(image),
        neighbours_(neighbours),
        apart_(static_cast<float>(kApartPx * per_pixel)),
        reach_(reach) {}

  InverseDepthMap run(const InverseDepthMap& map) const {
    InverseDepthMap current = map, behind(map.width, map.height, kUnknownDepth);
    BackgroundPlanes planes(map, image_, reach_);
    std::vector<float> worse(map.values.size());  // by how many codes the neighbours agree less
    // 0: something changed, or may, near the pixel.
    std::vector<std::uint8_t> is_settled(map.values.size(), 0);
    for (int i = 0; i < kRounds; ++i) {
      std::vector<std::uint8_t> unchanged(map.values.size(), 1);
      propose(current, is_settled, planes, behind, worse);
      current = accepted(current, behind, worse, unchanged);
      if (i + 1 == kRounds || std::ranges::find(unchanged, 0) == unchanged.end()) break;
      is_settled = std::move(unchanged);
      minimum_within(is_settled, map.width, map.height, reach_);
    }
    return current;
  }

 private:
  /// Returns the map with the proposed depths that the neighbours do not contradict.
  static InverseDepthMap accepted(const InverseDepthMap& map, const InverseDepthMap& behind,
                                  const std::vector<float>& worse,
                                  std::vector<std::uint8_t>& unchanged) {
    InverseDepthMap result = map;
    raystage::parallel_for(0, map.height, [&](int y) {
      for (int x = 0; x < map.width; ++x) {
        const std::size_t at = map.offset(x, y);
        if (behind.values[at] < 0 || !(worse[at] <= kSlack)) continue;
        if (mean_around(behind, worse, x, y) > kMeanSlack) continue;
        result.values[at] = behind.values[at];
        unchanged[at] = 0;
      }
    });
    return result;
  }

  /// Finds the best depth of the background of each pixel that may have one; settled ones keep
  /// theirs.
  void propose(const InverseDepthMap& map, const std::vector<std::uint8_t>& is_settled,
               BackgroundPlanes& planes, InverseDepthMap& behind, std::vector<float>& worse) const {
    std::vector<float> farthest = map.values;
    for (float& depth : farthest) {
      if (depth < 0) depth = std::numeric_limits<float>::max();
    }
    minimum_within(farthest, map.width, map.height, reach_);
    planes.set_depths(map);
    raystage::parallel_for(0, map.height, [&](int y) {
      RowBackground found(map.width);
      bool is_any_active = false;
      for (int x = 0; x < map.width; ++x) {
        const std::size_t at = map.offset(x, y);
        const float own = map.values[at];
        if (is_settled[at] != 0) continue;
        behind.values[at] = kUnknownDepth;
        if (own < 0 || farthest[at] > own - apart_ || !image_.is_known(x, y)) continue;
        found.is_active[x] = 1;
        is_any_active = true;
      }
      if (is_any_active) propose_row(map, planes, y, found, behind, worse);
    });
  }

  /// Returns the mean around a pixel, of those with a background; limits outliers.
  static double mean_around(const InverseDepthMap& behind, const std::vector<float>& worse, int x,
                            int y) {
    constexpr float kMost = 10;  // codes
    double sum = 0;
    int count = 0;
    for (int row = y - kMeanRadius; row <= y + kMeanRadius; ++row) {
      for (int column = x - kMeanRadius; column <= x + kMeanRadius; ++column) {
        if (!behind.contains(column, row)) continue;
        const std::size_t at = behind.offset(column, row);
        if (behind.values[at] < 0) continue;
        sum += static_cast<double>(std::clamp(worse[at], -kMost, kMost));
        ++count;
      }
    }
    return sum / count;
  }

  /// The background that may be behind the pixels of a row, found along the directions.
  struct RowBackground {
    explicit RowBackground(int width)
        : is_active(static_cast<std::size_t>(width) + kMostVectorLanes, 0.0F) {
      for (auto* planes : {&depth, &distance}) {
        for (std::vector<float>& of_direction : *planes) of_direction.resize(is_active.size());
      }
    }

    std::vector<float> is_active;
    std::array<std::vector<float>, kBackgroundDirections.size()> depth, distance;
  };

  /// Appends the depths that a pixel's background may have: the next ones along the directions, and
  /// those in between of opposite ones; none if there are too few. Returns their number.
  static std::size_t add_candidates(const RowBackground& found, std::size_t x,
                                    std::vector<float>& depths) {
    const std::size_t before = depths.size();
    for (std::size_t k = 0; k < kBackgroundDirections.size(); ++k) {
      if (found.distance[k][x] > 0) depths.push_back(found.depth[k][x]);
    }
    if (depths.size() - before < kDirections) {
      depths.resize(before);
      return 0;
    }
    for (std::size_t k = 0; k < kBackgroundDirections.size(); k += 2) {
      const float ahead = found.distance[k][x], back = found.distance[k + 1][x];
      if (ahead == 0 || back == 0) continue;
      const float first = found.depth[k][x], last = found.depth[k + 1][x];
      depths.push_back(first + ahead / (ahead + back) * (last - first));
    }
    return depths.size() - before;
  }

  /// The points of a row whose costs are compared: each pixel's candidates and then its own depth.
  struct RowPoints {
    struct Pixel {
      std::int32_t x;
      std::size_t candidates;
    };
    std::vector<Pixel> pixels;
    std::vector<std::int32_t> columns;
    std::vector<float> depths, costs;
  };

  void propose_row(const InverseDepthMap& map, const BackgroundPlanes& planes, int y,
                   RowBackground& found, InverseDepthMap& behind, std::vector<float>& worse) const {
    BackgroundRow row{&planes, y, reach_, apart_, kSameColour, found.is_active.data(), {}, {}};
    for (std::size_t k = 0; k < kBackgroundDirections.size(); ++k) {
      row.depth[k] = found.depth[k].data();
      row.distance[k] = found.distance[k].data();
    }
    find_background(row);
    RowPoints points;
    for (int x = 0; x < map.width; ++x) {
      if (!(found.is_active[x] > 0)) continue;
      const std::size_t candidates =
          add_candidates(found, static_cast<std::size_t>(x), points.depths);
      if (candidates == 0) continue;
      points.pixels.push_back({x, candidates});
      points.depths.push_back(map.at(x, y));
      points.columns.resize(points.depths.size(), x);
    }
    points.costs.resize(points.depths.size());
    compute_agreement(
        {y, &image_, neighbours_, points.columns, points.depths, points.costs.data()});
    const float* cost = points.costs.data();
    const float* depth = points.depths.data();
    for (const auto& [x, candidates] : points.pixels) {
      const std::size_t at = map.offset(x, y);
      float least = std::numeric_limits<float>::infinity();
      for (std::size_t i = 0; i < candidates; ++i) {
        if (!(cost[i] < least - kBetter)) continue;
        least = cost[i];
        behind.values[at] = depth[i];
      }
      if (std::isfinite(least)) worse[at] = least - cost[candidates];
      cost += candidates + 1;
      depth += candidates + 1;
    }
  }

  const MatchingImage& image_;
  std::span<const NeighbourView> neighbours_;
  float apart_;
  int reach_;
};

}  // namespace

int fattening_reach(int width) { return std::max(kLeastReach, width / kReachPerWidth); }

InverseDepthMap reduce_foreground_fattening(const InverseDepthMap& map, const MatchingImage& image,
                                            std::span<const NeighbourView> neighbours,
                                            double per_pixel, int reach) {
  return FatteningCorrection(image, neighbours, per_pixel, reach).run(map);
}

}  // namespace raystage::render
