// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stop_token>
#include <vector>

#include "rig/photometric_model.h"
#include "store/take.h"

namespace raystage {

/// Part of a picture, and what is shown there.
struct FlatFieldCell {
  double x = 0, y = 0;  ///< its middle, pixels from the picture's top-left corner
  Rgb mean{};
};

/// What one camera shows of a target that is everywhere as bright: linear light, full scale 1.
struct FlatFieldMeasurement {
  static constexpr double kDark = 0.1;  ///< brighter ones say little about what is seen in the dark
  Rgb mean{};          ///< over the middle of the picture, half of its width and height
  Rgb deviation{};     ///< there, from pixel to pixel
  Rgb black{};         ///< share of pixels at code 0 there: they may be darker than they can say
  double clipped = 0;  ///< share of pixels with a channel at full scale there
  PictureSize size;
  std::vector<FlatFieldCell> cells;  ///< all of the picture, by rows
  /// Where the mean over frames stands out from the pixels around, by how much: by rows.
  std::vector<HotPixel> hot_pixels;
};

/// The mean over at most `most_frames` frames, spread over the take; `response`: of the camera,
/// whose curve alone counts. Throws Error (bad input) for a camera without frames.
FlatFieldMeasurement measure_flat_field(const Take& take, int camera,
                                        const PhotometricResponse& response = {},
                                        int most_frames = 12);

/// Sights of all cameras in one take of a target.
using FlatFieldMeasurements = std::vector<FlatFieldMeasurement>;
/// `responses`: of each camera, or none.
FlatFieldMeasurements measure_flat_fields(const Take& take,
                                          const std::vector<PhotometricResponse>& responses,
                                          const std::stop_token& stop);

}  // namespace raystage
