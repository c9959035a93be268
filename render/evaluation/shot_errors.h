// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <string>
#include <string_view>
#include <vector>

#include "store/jpeg/rgb_image.h"

namespace raystage {

/// How the error of a shot changes while it goes on.
struct ShotStability {
  std::string id;
  int views = 0;
  /// Of each pixel's signed error over the views, the variance; of these the mean over the pixels
  /// that all views cover and their channels. Squared 8-bit codes; what flickers. 0 for one view,
  /// not-a-number without a pixel.
  double error_variance = 0;
  double mean_square_error = 0;  ///< over the same pixels: what flickers and what does not
};

/// The shot that a view belongs to: its id without a number at the end behind '_' or '-'
/// ("dolly_3": "dolly"); the id itself where there is none.
std::string_view shot_of_view(std::string_view id);

/// Gathers the views' errors by shot. Keeps 9 bytes a pixel and channel for each shot.
class ShotErrors {
 public:
  /// `covered`: 1 per pixel that counts. Views of one shot that differ in size from its first do
  /// not count.
  void add(std::string_view view_id, const RgbImage& image, const RgbImage& truth,
           std::span<const std::uint8_t> covered);
  /// Shots of at least two views, in the order in which they came.
  std::vector<ShotStability> temporal_stability() const;

 private:
  struct Shot {
    std::string id;
    int width = 0, height = 0, views = 0;
    std::vector<std::int32_t> sum, square_sum;  ///< of errors, codes; per pixel and channel
    std::vector<std::uint8_t> covered;          ///< 1 per pixel that all views cover
  };
  std::vector<Shot> shots_;
};

}  // namespace raystage
