// SPDX-License-Identifier: Apache-2.0
// Computes the Pareto front of points by cost and quality: sorts by cost and keeps the points of
// increasing quality. Input: any numbers, NaN excluded. Cost: O(n log n).
#include "evaluation/pareto_front.h"

#include <algorithm>
#include <cmath>
#include <cstddef>

namespace raystage::evaluation {

std::vector<char> pareto_front(std::span<const ParetoPoint> points) {
  std::vector<std::size_t> order;
  for (std::size_t i = 0; i < points.size(); ++i) {
    if (!std::isnan(points[i].cost) && !std::isnan(points[i].quality)) order.push_back(i);
  }
  std::ranges::sort(order, [&](std::size_t a, std::size_t b) {
    return points[a].cost != points[b].cost ? points[a].cost < points[b].cost
                                            : points[a].quality > points[b].quality;
  });
  std::vector<char> front(points.size(), 0);
  const ParetoPoint* last = nullptr;  // the best of all cheaper points
  for (const std::size_t i : order) {
    const ParetoPoint& point = points[i];
    const bool same = last != nullptr && point.cost == last->cost && point.quality == last->quality;
    if (last != nullptr && point.quality <= last->quality && !same) continue;
    front[i] = 1;
    last = &point;
  }
  return front;
}

}  // namespace raystage::evaluation
