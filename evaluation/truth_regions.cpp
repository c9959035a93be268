// SPDX-License-Identifier: Apache-2.0
#include "evaluation/truth_regions.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstddef>

namespace raystage::evaluation {
namespace {

using Mask = std::vector<std::uint8_t>;

constexpr double kEdge = 1;    // pixels of disparity between two surfaces
constexpr int kBandWidth = 8;  // pixels
constexpr int kThinWidth = 6, kThinMargin = 2;
constexpr int kPlaneRadius = 2;
constexpr double kPlaneResidual = 5e-4;  // pixels of disparity: that of a ball of 0.3 m is larger

class Regions {
 public:
  explicit Regions(const TrueDepths& truth) : width_(truth.width), height_(truth.height) {
    disparity_.reserve(truth.z.size());
    for (const float z : truth.z) {
      disparity_.push_back(z > 0 ? truth.disparity_scale / z : kUnknown);
    }
  }

  TruthRegions find() const {
    return {grown(edges(), kBandWidth), grown(thin(), kThinMargin), planes()};
  }

 private:
  std::size_t at(int x, int y) const {
    return static_cast<std::size_t>(y) * static_cast<std::size_t>(width_) +
           static_cast<std::size_t>(x);
  }
  bool is_inside(int x, int y) const { return x >= 0 && y >= 0 && x < width_ && y < height_; }

  bool is_known(int x, int y) const { return is_inside(x, y) && disparity_[at(x, y)] != kUnknown; }

  template <class Test>
  Mask mask_of(const Test& test) const {
    Mask mask(disparity_.size(), 0);
    for (int y = 0; y < height_; ++y) {
      for (int x = 0; x < width_; ++x) mask[at(x, y)] = test(x, y) ? 1 : 0;
    }
    return mask;
  }

  Mask edges() const {
    return mask_of([&](int x, int y) {
      const double here = disparity_[at(x, y)];
      const auto differs = [&](int other_x, int other_y) {
        return is_known(other_x, other_y) && is_known(x, y) &&
               std::abs(disparity_[at(other_x, other_y)] - here) > kEdge;
      };
      return differs(x + 1, y) || differs(x - 1, y) || differs(x, y + 1) || differs(x, y - 1);
    });
  }

  Mask thin() const {
    constexpr std::array<std::array<int, 2>, 4> kDirections{{{1, 0}, {0, 1}, {1, 1}, {1, -1}}};
    return mask_of([&](int x, int y) {
      const double here = disparity_[at(x, y)];
      // Returns after how many pixels what is seen is farther; beyond kThinWidth: not near.
      const auto steps = [&](int dx, int dy) {
        int i = 1;
        while (i <= kThinWidth && is_known(x + i * dx, y + i * dy) &&
               disparity_[at(x + i * dx, y + i * dy)] > here - kEdge) {
          ++i;
        }
        return is_known(x + i * dx, y + i * dy) ? i : kThinWidth + 1;
      };
      return is_known(x, y) && std::ranges::any_of(kDirections, [&](const std::array<int, 2>& d) {
               return steps(d[0], d[1]) + steps(-d[0], -d[1]) - 1 <= kThinWidth;
             });
    });
  }

  /// Fits a plane to the window by least squares: its mean and slopes are sums over the window,
  /// because that is symmetric.
  Mask planes() const {
    constexpr int kSide = 2 * kPlaneRadius + 1;
    constexpr double kCount = kSide * kSide;
    constexpr double kMoment = kSide * 2.0 * (1 + 4);  // sum of x^2 over the window
    return mask_of([&](int x, int y) {
      if (!is_inside(x - kPlaneRadius, y - kPlaneRadius) ||
          !is_inside(x + kPlaneRadius, y + kPlaneRadius) || !(disparity_[at(x, y)] > 0)) {
        return false;
      }
      for (int j = -kPlaneRadius; j <= kPlaneRadius; ++j) {
        for (int i = -kPlaneRadius; i <= kPlaneRadius; ++i) {
          if (!is_known(x + i, y + j)) return false;
        }
      }
      double mean = 0, slope_x = 0, slope_y = 0;
      for (int j = -kPlaneRadius; j <= kPlaneRadius; ++j) {
        for (int i = -kPlaneRadius; i <= kPlaneRadius; ++i) {
          const double value = disparity_[at(x + i, y + j)];
          mean += value / kCount;
          slope_x += i * value / kMoment;
          slope_y += j * value / kMoment;
        }
      }
      for (int j = -kPlaneRadius; j <= kPlaneRadius; ++j) {
        for (int i = -kPlaneRadius; i <= kPlaneRadius; ++i) {
          const double fitted = mean + i * slope_x + j * slope_y;
          if (std::abs(disparity_[at(x + i, y + j)] - fitted) > kPlaneResidual) return false;
        }
      }
      return true;
    });
  }

  /// Returns the pixels within a distance (along rows and columns) of a mask.
  Mask grown(const Mask& mask, int distance) const {
    const auto pass = [&](const Mask& from, int dx, int dy) {
      return mask_of([&](int x, int y) {
        for (int i = -distance; i <= distance; ++i) {
          if (is_inside(x + i * dx, y + i * dy) && from[at(x + i * dx, y + i * dy)] != 0) {
            return true;
          }
        }
        return false;
      });
    };
    return pass(pass(mask, 1, 0), 0, 1);
  }

  int width_, height_;
  static constexpr double kUnknown = -1;
  std::vector<double> disparity_;  // pixels between neighbouring cameras; 0: infinitely far
};

}  // namespace

TruthRegions truth_regions(const TrueDepths& truth) { return Regions(truth).find(); }

}  // namespace raystage::evaluation
