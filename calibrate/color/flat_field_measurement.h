// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <stop_token>
#include <vector>

#include "rig/photometric_model.h"
#include "store/take.h"

namespace raystage::calibrate {

/// Mean over a cell of a picture.
struct FlatFieldCell {
  double x = 0, y = 0;  ///< its centre, pixels from the picture's top-left corner
  schemas::Rgb mean{};
};

/// Measurement of an evenly lit target by one camera: linear light, full scale 1.
struct FlatFieldMeasurement {
  static constexpr double kDark = 0.1;  ///< largest mean of a dark target
  schemas::Rgb mean{};                  ///< over the central half of width and height
  schemas::Rgb deviation{};             ///< standard deviation of the pixels there
  schemas::Rgb black{};  ///< share of pixels at code 0 there, whose light may be below 0
  double clipped = 0;    ///< share of pixels with a channel at full scale there
  rig::PictureSize size;
  std::vector<FlatFieldCell> cells;  ///< over the whole picture, by rows
  /// Pixels whose mean over frames exceeds their surroundings, with the difference; by rows.
  std::vector<schemas::HotPixel> hot_pixels;
};

/// Returns the mean over at most `most_frames` frames, spread over the take. Of `response` it uses
/// the curve only. Throws Error (bad input) for a camera without frames.
FlatFieldMeasurement measure_flat_field(const store::Take& take, int camera,
                                        const schemas::PhotometricResponse& response = {},
                                        int most_frames = 12);

/// Measurements of all cameras in one take of a target.
using FlatFieldMeasurements = std::vector<FlatFieldMeasurement>;
/// Returns the measurements of all cameras. `responses`: one per camera, or empty.
FlatFieldMeasurements measure_flat_fields(
    const store::Take& take, const std::vector<schemas::PhotometricResponse>& responses,
    const std::stop_token& stop);

}  // namespace raystage::calibrate
