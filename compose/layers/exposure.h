// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <vector>

#include "compose/layers/layer_image.h"

namespace raystage::compose {

/// Averages images of one frame over the time that the shutter is open, by the trapezoidal rule:
/// first of the middle and both ends, then also of the times halfway between those, and so on.
/// Colours, A, lf.coverage and ids are averaged (ids by their coverage). Z and the other AOVs are
/// those of the middle; pixels that are empty then have those of the first image that shows
/// something there.
class ExposureAverage {
 public:
  /// Of the images of both ends, relative to those between them.
  static constexpr float kEndWeight = 0.5F;

  /// `middle`: of the middle of the exposure.
  explicit ExposureAverage(LayerImage middle);

  /// Adds the image of one end of the exposure.
  void add_end(const LayerImage& image) { add(image, kEndWeight); }
  /// Adds an image of a time between the ends, halfway between two that are averaged.
  void add(const LayerImage& image) { add(image, 1); }
  /// Ends a level: all times halfway between those of the level before were added. Returns the
  /// largest change of the averaged colours and of A, relative to colours above 1; none for the
  /// first level, which is that of the middle and the ends.
  std::optional<float> end_level();

  /// Returns the average of all levels that were ended.
  LayerImage finish() &&;

  /// Returns the memory of an average in addition to the image of the middle, bytes per pixel.
  static std::size_t bytes_per_pixel(std::size_t averaged_aov_channels, bool has_ids);

 private:
  void add(const LayerImage& image, float weight);
  /// Prepares the sums of an AOV of the middle, if it is averaged.
  void prepare_aov(std::size_t index);
  /// Adds AOVs, and memory for ids, that the middle does not have.
  void add_aovs_of(const LayerImage& image);
  void fill_empty_pixels(const LayerImage& image);

  /// Weighted sums of values that are averaged.
  struct Sums {
    render::PixelValues rgba;
    std::vector<render::PixelValues> aovs;  ///< of each averaged AOV
  };

  LayerImage middle_;
  std::vector<std::size_t> averaged_;  ///< indices of AOVs
  Sums before_, level_;                ///< of the levels before, of this level
  render::PixelValues id_coverage_;    ///< pairs of ids and weighted coverages
  int levels_ = 0;
};

}  // namespace raystage::compose
