// SPDX-License-Identifier: Apache-2.0
// Chooses the windows in which pictures of the same views are compared. Every candidate has a score
// for each reason (CropReason). The reasons choose in turn, greedily; a choice lowers the
// scores of the windows that overlap it. Cost: candidates x chosen windows x reasons.
#include "evaluation/crop_places.h"

#include <algorithm>
#include <array>
#include <cmath>
#include <cstdint>
#include <optional>

#include "evaluation/evaluation.h"

namespace raystage::evaluation {
namespace {

constexpr std::array kReasons{CropReason::kDifference, CropReason::kError, CropReason::kEdge,
                              CropReason::kThin};

/// Returns the share of a window that another one has, too.
double shared_part(const Window& a, const Window& b) {
  const int width = std::min(a.x + a.width, b.x + b.width) - std::max(a.x, b.x);
  const int height = std::min(a.y + a.height, b.y + b.height) - std::max(a.y, b.y);
  return static_cast<double>(std::max(0, width)) * std::max(0, height) / (a.width * a.height);
}

/// Returns 0 if the reason does not apply.
double score_of(const CropCandidate& candidate, CropReason reason) {
  double smallest = std::numeric_limits<double>::infinity(), largest = 0, edge = 0, thin = 0;
  for (const WindowErrors& errors : candidate.errors) {
    edge += errors.edge / static_cast<double>(candidate.errors.size());
    thin += errors.thin / static_cast<double>(candidate.errors.size());
    if (std::isnan(errors.rms)) continue;
    smallest = std::min(smallest, errors.rms);
    largest = std::max(largest, errors.rms);
  }
  switch (reason) {
    case CropReason::kDifference:
      return std::max(0.0, largest - smallest);
    case CropReason::kError:
      return std::isfinite(smallest) ? smallest : 0;
    case CropReason::kEdge:
      return edge;
    case CropReason::kThin:
      return thin;
  }
  return 0;
}

/// Returns the factor of a candidate's scores after another one was chosen.
double weight_after(const CropCandidate& candidate, const CropCandidate& chosen) {
  const double shared = shared_part(candidate.window, chosen.window);
  if (candidate.view == chosen.view) return shared > 0 ? 0 : 1;
  constexpr double kLikeness = 0.9;  // of the same pixels in another view
  return 1 - kLikeness * shared;
}

/// Returns the first pixels of windows every half side, up to the one that ends at the border.
std::vector<int> window_starts(int length, int side) {
  std::vector<int> starts;
  for (int start = 0; start + side < length; start += std::max(1, side / 2)) {
    starts.push_back(start);
  }
  starts.push_back(std::max(0, length - side));
  return starts;
}

}  // namespace

WindowErrors window_errors(const EvaluatedView& view, const Window& window) {
  double covered = 0, all = 0, edge = 0, thin = 0;
  for (int y = window.y; y < window.y + window.height; ++y) {
    for (int x = window.x; x < window.x + window.width; ++x) {
      const std::size_t pixel = static_cast<std::size_t>(y) * view.image.width + x;
      if (view.covered[pixel] == 0) continue;
      double squares = 0;
      for (std::size_t i = 3 * pixel; i < 3 * pixel + 3; ++i) {
        const double error = static_cast<double>(view.image.values[i]) - view.truth.values[i];
        squares += error * error / 3;
      }
      ++covered;
      all += squares;
      if (view.regions == nullptr) continue;
      if (view.regions->edge_band[pixel] != 0) edge += squares;
      if (view.regions->thin[pixel] != 0) thin += squares;
    }
  }
  const double pixels = static_cast<double>(window.width) * window.height;
  WindowErrors errors{.edge = edge / pixels, .thin = thin / pixels};
  if (covered > 0 && 2 * covered >= pixels) errors.rms = std::sqrt(all / covered);
  return errors;
}

std::vector<Window> windows_of_view(int width, int height, int side) {
  std::vector<Window> windows;
  for (const int y : window_starts(height, side)) {
    for (const int x : window_starts(width, side)) {
      windows.push_back({x, y, std::min(side, width), std::min(side, height)});
    }
  }
  return windows;
}

std::vector<CropPlace> choose_crop_places(std::span<const CropCandidate> candidates,
                                          std::size_t count) {
  std::array<std::vector<double>, kReasons.size()> scores;
  for (std::size_t r = 0; r < kReasons.size(); ++r) {
    for (const CropCandidate& one : candidates) scores[r].push_back(score_of(one, kReasons[r]));
  }
  std::vector<double> weights(candidates.size(), 1);
  std::vector<CropPlace> places;
  for (bool has_found = true; has_found;) {
    has_found = false;
    for (std::size_t r = 0; r < kReasons.size() && places.size() < count; ++r) {
      std::optional<std::size_t> best;
      double best_score = 0;
      for (std::size_t i = 0; i < candidates.size(); ++i) {
        if (!(scores[r][i] * weights[i] > best_score)) continue;
        best = i;
        best_score = scores[r][i] * weights[i];
      }
      if (!best) continue;
      places.push_back({*best, kReasons[r]});
      has_found = true;
      for (std::size_t i = 0; i < candidates.size(); ++i) {
        weights[i] *= weight_after(candidates[i], candidates[*best]);
      }
    }
  }
  return places;
}

}  // namespace raystage::evaluation
