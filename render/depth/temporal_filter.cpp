// SPDX-License-Identifier: Apache-2.0
// Averages a camera's inverse depth map (1/m) with those of temporal neighbours where the mean
// absolute luma difference over a window is small; see temporal_filter(). The window sums are
// running sums by rows and columns. Cost: O(pixels x neighbours). Reference:
// temporal_filter_reference().
#include "render/depth/temporal_filter.h"

#include <algorithm>
#include <cmath>
#include <cstdlib>
#include <vector>

namespace raystage::render {
namespace {

/// Returns the weight of a neighbour by its mean luma difference.
float stillness(float codes) { return std::clamp(2 - codes / kStaticLumaThreshold, 0.0F, 1.0F); }

/// Absolute luma differences, summed per column over the rows within kStaticWindowRadius; rows and
/// columns at the border are repeated outwards.
class ChangeRows {
 public:
  ChangeRows(const Luma& a, const Luma& b)
      : a_(a), b_(b), columns_(static_cast<std::size_t>(a.width)) {}

  /// Writes the window's mean at each pixel of row y; rows must be requested in turn, from 0.
  void means(int y, std::vector<float>& of_row) {
    if (y == 0) {
      for (int i = -kStaticWindowRadius; i <= kStaticWindowRadius; ++i) add(i, 1);
    } else {
      add(y - kStaticWindowRadius - 1, -1);
      add(y + kStaticWindowRadius, 1);
    }
    constexpr float kPixels = (2 * kStaticWindowRadius + 1) * (2 * kStaticWindowRadius + 1);
    const auto column = [&](int x) { return columns_[std::clamp(x, 0, a_.width - 1)]; };
    int sum = 0;
    for (int i = -kStaticWindowRadius; i <= kStaticWindowRadius; ++i) sum += column(i);
    for (int x = 0; x < a_.width; ++x) {
      of_row[x] = static_cast<float>(sum) / kPixels;
      sum += column(x + kStaticWindowRadius + 1) - column(x - kStaticWindowRadius);
    }
  }

 private:
  void add(int row, int sign) {
    const int y = std::clamp(row, 0, a_.height - 1);
    for (int x = 0; x < a_.width; ++x) {
      columns_[x] += sign * std::abs(static_cast<int>(a_.at(x, y)) - static_cast<int>(b_.at(x, y)));
    }
  }

  const Luma &a_, &b_;
  std::vector<int> columns_;
};

}  // namespace

InverseDepthMap temporal_filter(const InverseDepthMap& depths, const Luma& luma,
                                std::span<const TemporalNeighbour> others, float tolerance) {
  const auto width = static_cast<std::size_t>(depths.width);
  std::vector<ChangeRows> changes;
  for (const TemporalNeighbour& other : others) changes.emplace_back(luma, *other.luma);
  std::vector<float> change(width), sum(width), weights(width);
  InverseDepthMap result = depths;
  for (int y = 0; y < depths.height; ++y) {
    const std::size_t row = static_cast<std::size_t>(y) * width;
    for (std::size_t x = 0; x < width; ++x) sum[x] = depths.values[row + x];
    std::ranges::fill(weights, 1.0F);
    for (std::size_t i = 0; i < others.size(); ++i) {
      changes[i].means(y, change);
      for (std::size_t x = 0; x < width; ++x) {
        const float other = others[i].depths->values[row + x];
        const float apart = std::abs(other - depths.values[row + x]) / tolerance;
        const float weight = stillness(change[x]) * std::max(0.0F, 1 - apart);
        if (other < 0) continue;
        sum[x] += weight * other;
        weights[x] += weight;
      }
    }
    for (std::size_t x = 0; x < width; ++x) {
      if (depths.values[row + x] >= 0) result.values[row + x] = sum[x] / weights[x];
    }
  }
  return result;
}

InverseDepthMap temporal_filter_reference(const InverseDepthMap& depths, const Luma& luma,
                                          std::span<const TemporalNeighbour> others,
                                          float tolerance) {
  InverseDepthMap result = depths;
  for (int y = 0; y < depths.height; ++y) {
    for (int x = 0; x < depths.width; ++x) {
      const auto now = static_cast<double>(depths.at(x, y));
      if (now < 0) continue;
      double sum = now, weights = 1;
      for (const TemporalNeighbour& other : others) {
        const auto then = static_cast<double>(other.depths->at(x, y));
        if (then < 0) continue;
        double change = 0, pixels = 0;
        for (int j = y - kStaticWindowRadius; j <= y + kStaticWindowRadius; ++j) {
          for (int i = x - kStaticWindowRadius; i <= x + kStaticWindowRadius; ++i, ++pixels) {
            const int column = std::clamp(i, 0, depths.width - 1);
            const int row = std::clamp(j, 0, depths.height - 1);
            change += std::abs(static_cast<double>(luma.at(column, row)) -
                               static_cast<double>(other.luma->at(column, row)));
          }
        }
        const double still =
            std::clamp(2 - change / pixels / static_cast<double>(kStaticLumaThreshold), 0.0, 1.0);
        const double weight =
            still * std::max(0.0, 1 - std::abs(then - now) / static_cast<double>(tolerance));
        sum += weight * then;
        weights += weight;
      }
      result.at(x, y) = static_cast<float>(sum / weights);
    }
  }
  return result;
}

}  // namespace raystage::render
