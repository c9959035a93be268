// SPDX-License-Identifier: Apache-2.0
// Accumulates sums of the signed errors (8-bit codes) and their squares per pixel and channel of
// each shot; their difference is the variance over the views. Cost: O(pixels) per view.
#include "evaluation/shot_errors.h"

#include <algorithm>
#include <limits>

namespace raystage::evaluation {

std::string_view shot_of_view(std::string_view id) {
  const std::size_t last = id.find_last_not_of("0123456789");
  const bool numbered = last != std::string_view::npos && last > 0 && last + 1 < id.size() &&
                        (id[last] == '_' || id[last] == '-');
  return numbered ? id.substr(0, last) : id;
}

void ShotErrors::add(std::string_view view_id, const store::RgbImage& image,
                     const store::RgbImage& truth, std::span<const std::uint8_t> covered,
                     std::span<const std::uint8_t> edge_band) {
  const std::string_view id = shot_of_view(view_id);
  auto shot = std::ranges::find(shots_, id, &Shot::id);
  if (shot == shots_.end()) {
    shots_.push_back({std::string(id),
                      image.width,
                      image.height,
                      0,
                      std::vector<std::int32_t>(image.values.size()),
                      std::vector<std::int32_t>(image.values.size()),
                      std::vector<std::uint8_t>(covered.size(), 1),
                      {},
                      {},
                      {}});
    shot = std::prev(shots_.end());
  }
  if (shot->width != image.width || shot->height != image.height) return;
  ++shot->views;
  for (std::size_t i = 0; i < image.values.size(); ++i) {
    const int error = int{image.values[i]} - int{truth.values[i]};
    shot->sum[i] += error;
    shot->square_sum[i] += error * error;
  }
  for (std::size_t i = 0; i < covered.size(); ++i) shot->covered[i] &= covered[i];
  if (!edge_band.empty()) shot->add_band(image, truth, covered, edge_band);
}

void ShotErrors::Shot::add_band(const store::RgbImage& image, const store::RgbImage& truth,
                                std::span<const std::uint8_t> counted,
                                std::span<const std::uint8_t> band) {
  band_sum.resize(image.values.size());
  band_square_sum.resize(image.values.size());
  band_views.resize(band.size());
  for (std::size_t pixel = 0; pixel < band.size(); ++pixel) {
    if (band[pixel] == 0 || counted[pixel] == 0) continue;
    ++band_views[pixel];
    for (std::size_t i = 3 * pixel; i < 3 * pixel + 3; ++i) {
      const int error = int{image.values[i]} - int{truth.values[i]};
      band_sum[i] += error;
      band_square_sum[i] += error * error;
    }
  }
}

double ShotErrors::Shot::band_error_variance() const {
  double deviations = 0, count = 0;
  for (std::size_t i = 0; i < band_sum.size(); ++i) {
    const double in_band = band_views[i / 3];
    if (in_band < 2) continue;
    deviations += band_square_sum[i] - static_cast<double>(band_sum[i]) * band_sum[i] / in_band;
    count += in_band;
  }
  return count > 0 ? deviations / count : std::numeric_limits<double>::quiet_NaN();
}

std::vector<ShotStability> ShotErrors::temporal_stability() const {
  std::vector<ShotStability> all;
  for (const Shot& shot : shots_) {
    if (shot.views < 2) continue;
    ShotStability temporal_stability{shot.id, shot.views};
    double count = 0;
    for (std::size_t i = 0; i < shot.sum.size(); ++i) {
      if (shot.covered[i / 3] == 0) continue;
      const double mean = static_cast<double>(shot.sum[i]) / shot.views;
      const double mean_square = static_cast<double>(shot.square_sum[i]) / shot.views;
      temporal_stability.error_variance += mean_square - mean * mean;
      temporal_stability.mean_square_error += mean_square;
      ++count;
    }
    const double none = std::numeric_limits<double>::quiet_NaN();
    temporal_stability.error_variance =
        count > 0 ? temporal_stability.error_variance / count : none;
    temporal_stability.mean_square_error =
        count > 0 ? temporal_stability.mean_square_error / count : none;
    temporal_stability.edge_band_error_variance = shot.band_error_variance();
    all.push_back(temporal_stability);
  }
  return all;
}

}  // namespace raystage::evaluation
