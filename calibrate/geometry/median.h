// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <vector>

namespace raystage::calibrate {

/// Returns the median of at least one value; of an even number, the upper of the two in the middle.
template <class T>
T median(std::vector<T> values) {
  const auto middle = values.begin() + values.size() / 2;
  std::ranges::nth_element(values, middle);
  return *middle;
}

}  // namespace raystage::calibrate
