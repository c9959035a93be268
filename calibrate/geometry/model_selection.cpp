// SPDX-License-Identifier: Apache-2.0
#include "calibrate/geometry/model_selection.h"

#include <algorithm>
#include <cmath>
#include <numeric>

#include "schemas/projection_names.h"

namespace raystage::calibrate {

double rms_of(std::span<const HeldOutError> errors) {
  double sum = 0;
  int count = 0;
  for (const HeldOutError& error : errors) {
    sum += error.sum;
    count += error.count;
  }
  return std::sqrt(sum / std::max(count, 1));
}

bool fit_worse(std::span<const HeldOutError> model, std::span<const HeldOutError> other) {
  constexpr double kLeast = 1e-12;  // pixels squared
  std::vector<double> ratios;
  for (std::size_t i = 0; i < model.size(); ++i) {
    ratios.push_back(std::log((model[i].sum + kLeast) / (other[i].sum + kLeast)));
  }
  if (ratios.size() < 2) return false;
  const auto count = static_cast<double>(ratios.size());
  const double mean = std::accumulate(ratios.begin(), ratios.end(), 0.0) / count;
  double squares = 0;
  for (const double ratio : ratios) squares += (ratio - mean) * (ratio - mean);
  return mean > 2 * std::sqrt(squares / (count - 1) / count);
}

std::optional<std::size_t> simplest_model(const std::vector<bool>& is_worse,
                                          std::span<const double> distortions) {
  if (!is_worse.front()) return 0;
  std::optional<std::size_t> least;
  for (std::size_t k = 0; k < is_worse.size(); ++k) {
    if (is_worse[k] || (least && distortions[k] >= distortions[*least])) continue;
    least = k;
  }
  return least;
}

std::string compared_model_name(schemas::Projection projection) {
  if (projection == schemas::Projection::kFisheye) return "fisheye = ftheta";
  return std::string(schemas::name_of(projection));
}

std::string_view model_rank(bool is_best, bool is_worse) {
  if (is_best) return "best";
  return is_worse ? "worse" : "not distinguishable";
}

}  // namespace raystage::calibrate
