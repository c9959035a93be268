// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "store/jpeg/rgb_image.h"

namespace raystage::evaluation {

/// The temporal variation of a shot's error.
struct ShotStability {
  std::string id;
  int views = 0;
  /// Flicker: the variance over the views of a pixel's signed error, averaged over channels and the
  /// pixels that all views cover. Squared 8-bit codes. 0 for one view, NaN without a pixel.
  double error_variance = 0;
  double mean_square_error = 0;  ///< over the same pixels: flicker and constant error
  /// The flicker at edges of depth: of each pixel over the views in whose edge band it is, at least
  /// two, averaged over these pixels by their numbers of views. NaN if there is none.
  double edge_band_error_variance = 0;
};

/// Returns the shot of a view: its id without a trailing number after '_' or '-' ("dolly_3":
/// "dolly"); the id itself if there is none.
std::string_view shot_of_view(std::string_view id);

/// Accumulates the views' errors by shot. Memory: 9 bytes per pixel and channel for each shot, and
/// 9 more where edge bands are known.
class ShotErrors {
 public:
  /// Adds the errors of a view. `covered`: 1 per pixel that counts. `edge_band`: 1 per pixel of
  /// TruthRegions::edge_band; empty: unknown. Views of another size than the first of their shot
  /// are ignored.
  void add(std::string_view view_id, const store::RgbImage& image, const store::RgbImage& truth,
           std::span<const std::uint8_t> covered, std::span<const std::uint8_t> edge_band = {});
  /// Returns the shots of at least two views, in order of appearance.
  std::vector<ShotStability> temporal_stability() const;

 private:
  struct Shot {
    std::string id;
    int width = 0, height = 0, views = 0;
    std::vector<std::int32_t> sum, square_sum;  ///< of errors in codes, per pixel and channel
    std::vector<std::uint8_t> covered;          ///< 1 per pixel that all views cover
    std::vector<std::int32_t> band_sum, band_square_sum;  ///< of covered pixels in edge bands
    std::vector<std::uint16_t> band_views;                ///< per pixel; empty: no band is known

    void add_band(const store::RgbImage& image, const store::RgbImage& truth,
                  std::span<const std::uint8_t> covered, std::span<const std::uint8_t> band);
    double band_error_variance() const;
  };
  std::vector<Shot> shots_;
};

}  // namespace raystage::evaluation
