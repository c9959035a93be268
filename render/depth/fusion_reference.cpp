// SPDX-License-Identifier: Apache-2.0
// Reference of fuse_hypotheses() and domain_transform_filter() (fusion.cpp), pixel by pixel in
// double with any number of hypotheses. Inverse planar depths, 1/m. Cost: O(pixels x hypotheses^2).
#include <algorithm>
#include <cmath>

#include "render/depth/fusion.h"
#include "render/depth/warp.h"

namespace raystage::render {
namespace {

double weight_at(const VirtualCamera& view, const DepthHypotheses& hypothesis, int x, int y) {
  const int column = x / kDepthTile, row = y / kDepthTile;
  const auto& corners = hypothesis.weights[row * depth_tile_columns(view) + column];
  const int width = std::min(kDepthTile, view.width - column * kDepthTile);
  const int height = std::min(kDepthTile, view.height - row * kDepthTile);
  const double across = (x % kDepthTile + 0.5) / width, down = (y % kDepthTile + 0.5) / height;
  const auto corner = [&](std::size_t i) { return static_cast<double>(corners[i]); };
  return (1 - down) * ((1 - across) * corner(0) + across * corner(1)) +
         down * ((1 - across) * corner(2) + across * corner(3));
}

/// The depth with the largest support, and its share of the weights; see vote().
struct Agreed {
  double depth = static_cast<double>(kUnknownDepth), support = 0;
};
Agreed vote_of(const std::vector<double>& hypotheses, const std::vector<double>& weights,
               double tolerance) {
  Agreed agreed;
  double all = 0, best = 0, chosen = -1;
  for (std::size_t i = 0; i < hypotheses.size(); ++i) {
    if (hypotheses[i] < 0 || weights[i] <= 0) continue;
    all += weights[i];
    double support = 0, sum = 0;
    for (std::size_t j = 0; j < hypotheses.size(); ++j) {
      if (hypotheses[j] < 0) continue;
      const double weight =
          weights[j] * std::max(0.0, 1 - std::abs(hypotheses[j] - hypotheses[i]) / tolerance);
      support += weight;
      sum += weight * hypotheses[j];
    }
    const bool is_as_good = support > 0.9999 * best && hypotheses[i] > chosen;
    if (support > 1.0001 * best || is_as_good) {
      best = support;
      chosen = hypotheses[i];
      agreed.depth = sum / support;
    }
  }
  agreed.support = all > 0 ? best / all : 0;
  return agreed;
}

/// Returns the farthest of the depths next in the row and column that have enough support.
float depth_behind(const InverseDepthMap& depths, const InverseDepthMap& support, float min_support,
                   int x, int y) {
  constexpr int kReach = 40;  // pixels
  std::vector<float> around;
  for (const auto& [dx, dy] : {std::pair(1, 0), {-1, 0}, {0, 1}, {0, -1}}) {
    for (int i = 1; i <= kReach; ++i) {
      const int column = x + i * dx, row = y + i * dy;
      if (!depths.contains(column, row)) break;
      if (depths.at(column, row) < 0 || support.at(column, row) < min_support) continue;
      around.push_back(depths.at(column, row));
      break;
    }
  }
  return around.empty() ? depths.at(x, y) : *std::ranges::min_element(around);
}

InverseDepthMap median_reference(const InverseDepthMap& depths, float line_tolerance) {
  InverseDepthMap result = depths;
  for (int y = 0; y < depths.height; ++y) {
    for (int x = 0; x < depths.width; ++x) {
      std::vector<float> nine;
      for (int i = 0; i < 9; ++i) nine.push_back(depths.clamped(x + i % 3 - 1, y + i / 3 - 1));
      const float own = nine[4];
      bool line = false;
      for (std::size_t i = 0; i < 4; ++i) {
        line = line || (std::abs(nine[i] - own) <= line_tolerance &&
                        std::abs(nine[8 - i] - own) <= line_tolerance);
      }
      std::ranges::sort(nine);
      result.at(x, y) = line && own - nine[4] > line_tolerance ? own : nine[4];
    }
  }
  return result;
}

}  // namespace

InverseDepthMap fuse_hypotheses_reference(const VirtualCamera& view,
                                          std::span<const DepthHypotheses> hypotheses,
                                          const FusionOptions& options) {
  std::vector<InverseDepthMap> warped;
  for (const DepthHypotheses& hypothesis : hypotheses) {
    warped.push_back(warp_depths_reference(*hypothesis.map, *hypothesis.camera, view));
  }
  InverseDepthMap depths(view.width, view.height), support = depths;
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      std::vector<double> said, weights;
      for (std::size_t i = 0; i < hypotheses.size(); ++i) {
        said.push_back(static_cast<double>(warped[i].at(x, y)));
        weights.push_back(weight_at(view, hypotheses[i], x, y));
      }
      const Agreed found = vote_of(said, weights, static_cast<double>(options.tolerance));
      depths.at(x, y) = static_cast<float>(found.depth);
      support.at(x, y) = static_cast<float>(found.support);
    }
  }
  InverseDepthMap result = depths;
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      if (depths.at(x, y) >= 0 && support.at(x, y) >= options.min_support) continue;
      result.at(x, y) = depth_behind(depths, support, options.min_support, x, y);
    }
  }
  return median_reference(result, options.line_tolerance);
}

void domain_transform_filter_reference(std::vector<float>& values, int channels, int width,
                                       int height, const EdgeWeights& links) {
  const auto pixel = [&](int x, int y) { return static_cast<std::size_t>(y) * width + x; };
  const auto channel_count = static_cast<std::size_t>(channels);
  std::vector<double> exact(values.begin(), values.end());
  const auto draw = [&](std::size_t to, std::size_t from, float link) {
    for (std::size_t c = 0; c < channel_count; ++c) {
      double& value = exact[to * channel_count + c];
      value += static_cast<double>(link) * (exact[from * channel_count + c] - value);
    }
  };
  for (int y = 0; y < height; ++y) {
    for (int x = 1; x < width; ++x) draw(pixel(x, y), pixel(x - 1, y), links.left[pixel(x, y)]);
    for (int x = width - 2; x >= 0; --x) {
      draw(pixel(x, y), pixel(x + 1, y), links.left[pixel(x + 1, y)]);
    }
  }
  for (int x = 0; x < width; ++x) {
    for (int y = 1; y < height; ++y) draw(pixel(x, y), pixel(x, y - 1), links.above[pixel(x, y)]);
    for (int y = height - 2; y >= 0; --y) {
      draw(pixel(x, y), pixel(x, y + 1), links.above[pixel(x, y + 1)]);
    }
  }
  std::ranges::transform(exact, values.begin(),
                         [](double value) { return static_cast<float>(value); });
}

}  // namespace raystage::render
