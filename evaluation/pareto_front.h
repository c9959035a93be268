// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

namespace raystage::evaluation {

struct ParetoPoint {
  double cost = 0, quality = 0;
};

/// Returns 1 per point that no other point dominates: none has at most its cost, at least its
/// quality, and differs. Points with a NaN are dominated.
std::vector<char> pareto_front(std::span<const ParetoPoint> points);

}  // namespace raystage::evaluation
