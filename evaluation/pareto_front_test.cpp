// SPDX-License-Identifier: Apache-2.0
#include "evaluation/pareto_front.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <random>

namespace raystage::evaluation {
namespace {

/// Computes the front by its definition: compares every point with every other.
std::vector<char> front_reference(std::span<const ParetoPoint> points) {
  std::vector<char> front;
  for (const ParetoPoint& point : points) {
    bool beaten = std::isnan(point.cost) || std::isnan(point.quality);
    for (const ParetoPoint& other : points) {
      const bool differs = other.cost != point.cost || other.quality != point.quality;
      if (other.cost <= point.cost && other.quality >= point.quality && differs) beaten = true;
    }
    front.push_back(beaten ? 0 : 1);
  }
  return front;
}

TEST(ParetoFront, IsWhatComparingAllWithAllGives) {
  std::mt19937 random(3);
  for (int trial = 0; trial < 500; ++trial) {
    std::vector<ParetoPoint> points;
    const int count = static_cast<int>(random() % 12);
    for (int i = 0; i < count; ++i) {
      // Few values, so that ties and equal points are common.
      points.push_back({static_cast<double>(random() % 5), static_cast<double>(random() % 5)});
      if (random() % 9 == 0) points.back().quality = std::numeric_limits<double>::quiet_NaN();
      if (random() % 9 == 0) points.back().cost = std::numeric_limits<double>::infinity();
    }
    EXPECT_EQ(pareto_front(points), front_reference(points)) << "trial " << trial;
  }
}

TEST(ParetoFront, KeepsWhatIsWorthItsCost) {
  const std::vector<ParetoPoint> points{{3, 30}, {1, 20}, {2, 19}, {3, 31}, {1, 20}};
  EXPECT_EQ(pareto_front(points), (std::vector<char>{0, 1, 0, 1, 1}));
}

}  // namespace
}  // namespace raystage::evaluation
