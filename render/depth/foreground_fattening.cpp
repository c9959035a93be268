// SPDX-License-Identifier: Apache-2.0
// Corrects foreground fattening in a camera's depths. Only pixels with something farther within
// reach are looked at, and after the first round only those near corrected ones. Costs are the mean
// of the smaller half of the luma differences to the neighbours, as in match_row(). Input and
// output: inverse depths, 1/m. Cost: O(pixels near borders of surfaces x reach), and O(pixels) for
// the others. Reference: camera_depths_reference.cpp.
#include "render/depth/foreground_fattening.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <cstdlib>
#include <limits>
#include <optional>
#include <utility>
#include <vector>

#include "base/parallel.h"

namespace raystage::render {
namespace {

using namespace foreground_fattening;

/// Applies a running minimum over `reach` pixels to both sides, along rows and columns.
template <class Value>
void minimum_within(std::vector<Value>& values, int width, int height, int reach) {
  // The minimum over a window of 2 reach + 1 values from those of blocks of that size, from both
  // ends (van Herk 1992).
  const auto filter = [reach](Value* first, std::ptrdiff_t step, int count,
                              std::vector<Value>& before, std::vector<Value>& after) {
    constexpr Value kMost = std::numeric_limits<Value>::max();
    const int window = 2 * reach + 1, padded = count + 2 * reach;
    const auto at = [&](int i) {
      return i < reach || i >= reach + count ? kMost : first[(i - reach) * step];
    };
    before.resize(static_cast<std::size_t>(padded));
    after.resize(static_cast<std::size_t>(padded));
    for (int i = 0; i < padded; ++i) {
      before[i] = i % window == 0 ? at(i) : std::min(before[i - 1], at(i));
    }
    for (int i = padded; i-- > 0;) {
      after[i] = i + 1 == padded || (i + 1) % window == 0 ? at(i) : std::min(after[i + 1], at(i));
    }
    for (int i = 0; i < count; ++i) {
      first[i * step] = std::min(after[i], before[i + 2 * reach]);
    }
  };
  raystage::parallel_for(0, height, [&](int y) {
    std::vector<Value> before, after;
    filter(values.data() + static_cast<std::ptrdiff_t>(y) * width, 1, width, before, after);
  });
  constexpr int kColumns = 16;
  raystage::parallel_for(0, (width + kColumns - 1) / kColumns, [&](int strip) {
    std::vector<Value> before, after;
    const int end = std::min(width, (strip + 1) * kColumns);
    for (int x = strip * kColumns; x < end; ++x) {
      filter(values.data() + x, width, height, before, after);
    }
  });
}

class FatteningCorrection {
 public:
  FatteningCorrection(const MatchingImage& image, std::span<const NeighbourView> neighbours,
                      double per_pixel)
      : image_(image),
        neighbours_(neighbours),
        apart_(static_cast<float>(kApartPx * per_pixel)),
        reach_(fattening_reach(image.width())) {}

  InverseDepthMap run(const InverseDepthMap& map) const {
    InverseDepthMap current = map, behind(map.width, map.height, kUnknownDepth);
    std::vector<float> worse(map.values.size());  // by how many codes the neighbours agree less
    // 0: something changed, or may, near the pixel.
    std::vector<std::uint8_t> is_settled(map.values.size(), 0);
    for (int i = 0; i < kRounds; ++i) {
      std::vector<std::uint8_t> unchanged(map.values.size(), 1);
      propose(current, is_settled, behind, worse);
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
               InverseDepthMap& behind, std::vector<float>& worse) const {
    std::vector<float> farthest = map.values;
    for (float& depth : farthest) {
      if (depth < 0) depth = std::numeric_limits<float>::max();
    }
    minimum_within(farthest, map.width, map.height, reach_);
    raystage::parallel_for(0, map.height, [&](int y) {
      for (int x = 0; x < map.width; ++x) {
        const std::size_t at = map.offset(x, y);
        const float own = map.values[at];
        if (is_settled[at] != 0) continue;
        behind.values[at] = kUnknownDepth;
        if (own < 0 || farthest[at] > own - apart_ || !image_.is_known(x, y)) continue;
        const Candidates candidates = background(map, x, y, own - apart_);
        double least = std::numeric_limits<double>::infinity();
        for (std::size_t i = 0; i < candidates.count; ++i) {
          const double found = cost(x, y, candidates.depths[i]);
          if (!(found < least - kBetter)) continue;
          least = found;
          behind.values[at] = candidates.depths[i];
        }
        if (std::isfinite(least)) worse[at] = static_cast<float>(least - cost(x, y, own));
      }
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

  bool has_same_colour(int x, int y, int column, int row) const {
    if (!image_.is_known(column, row)) return false;
    if (std::abs(image_.luma(column, row) - image_.luma(x, y)) > kSameColour) return false;
    const auto here = image_.chroma(x, y), there = image_.chroma(column, row);
    return std::abs(there[0] - here[0]) + std::abs(there[1] - here[1]) <= kSameColour;
  }

  struct Candidates {
    std::array<float, 12> depths;
    std::size_t count = 0;
  };
  /// Returns the depths of the next pixels of the same colour that are at most as near as `far`,
  /// and those in between of opposite ones; none if there are too few.
  Candidates background(const InverseDepthMap& map, int x, int y, float far) const {
    constexpr std::array<std::array<int, 2>, 8> kSteps{
        {{1, 0}, {-1, 0}, {0, 1}, {0, -1}, {1, 1}, {-1, -1}, {1, -1}, {-1, 1}}};
    std::array<float, kSteps.size()> found{};
    std::array<int, kSteps.size()> distance{};  // steps; 0: not found
    Candidates result;
    for (std::size_t k = 0; k < kSteps.size(); ++k) {
      const auto [dx, dy] = kSteps[k];
      for (int i = 1; i <= reach_ && distance[k] == 0; ++i) {
        const int column = x + i * dx, row = y + i * dy;
        if (!map.contains(column, row)) break;
        const float there = map.at(column, row);
        if (there < 0 || there > far || !has_same_colour(x, y, column, row)) continue;
        found[k] = there;
        distance[k] = i;
        result.depths[result.count++] = there;
      }
    }
    if (result.count < kDirections) return {};
    for (std::size_t k = 0; k < kSteps.size(); k += 2) {
      if (distance[k] == 0 || distance[k + 1] == 0) continue;
      const float part =
          static_cast<float>(distance[k]) / static_cast<float>(distance[k] + distance[k + 1]);
      result.depths[result.count++] = found[k] + part * (found[k + 1] - found[k]);
    }
    return result;
  }

  /// Returns the mean of the smaller half of the luma differences to the neighbours that see the
  /// pixel's point at a depth, codes; infinite: none does.
  double cost(int x, int y, float inverse_depth) const {
    std::array<double, kMaxNeighbours> differences;
    std::size_t count = 0;
    for (const NeighbourView& view : neighbours_) {
      const auto luma = luma_at(view, x + 0.5, y + 0.5, static_cast<double>(inverse_depth));
      if (luma) differences[count++] = std::abs(*luma - image_.luma(x, y));
    }
    if (count == 0) return std::numeric_limits<double>::infinity();
    std::sort(differences.begin(), differences.begin() + static_cast<std::ptrdiff_t>(count));
    const std::size_t half = (count + 1) / 2;
    double sum = 0;
    for (std::size_t i = 0; i < half; ++i) sum += differences[i];
    return sum / static_cast<double>(half);
  }

  static std::optional<double> luma_at(const NeighbourView& view, double x, double y,
                                       double inverse_depth) {
    const auto part = [&](std::size_t r) {
      const double* m = view.transfer.direction.data() + 3 * r;
      return m[0] * x + m[1] * y + m[2] + inverse_depth * view.transfer.parallax[r];
    };
    const double w = part(2), u = part(0) / w, v = part(1) / w;
    const MatchingImage& image = *view.image;
    if (!(w > 0 && u >= 0 && v >= 0 && u <= image.width() && v <= image.height())) {
      return std::nullopt;
    }
    const double left = std::clamp(u - 0.5, 0.0, image.width() - 1.0);
    const double top = std::clamp(v - 0.5, 0.0, image.height() - 1.0);
    const int column = static_cast<int>(left), row = static_cast<int>(top);
    const std::uint32_t word =
        image.words()[static_cast<std::size_t>(row) * image.width() + column];
    if (word == 0) return std::nullopt;
    const double right = left - column, down = top - row;
    const auto code = [word](unsigned byte) {
      return static_cast<double>((word >> (8 * byte)) & 0xFFU);
    };
    return (1 - down) * ((1 - right) * code(0) + right * code(1)) +
           down * ((1 - right) * code(2) + right * code(3));
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
                                            double per_pixel) {
  return FatteningCorrection(image, neighbours, per_pixel).run(map);
}

}  // namespace raystage::render
