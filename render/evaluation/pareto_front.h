// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <vector>

namespace raystage {

/// What is paid and what is had for it.
struct ParetoPoint {
  double cost = 0, quality = 0;
};

/// 1 per point that no other beats: none costs as little or less and is as good or better, and
/// differs. Points with a not-a-number are beaten.
std::vector<char> pareto_front(std::span<const ParetoPoint> points);

}  // namespace raystage
