// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <stop_token>
#include <vector>

#include "rig/color_checker.h"
#include "rig/photometric_model.h"
#include "store/take.h"

namespace raystage::calibrate {

/// Measurement of a ColorChecker Classic by one camera: patches by rows, starting with dark skin.
struct ChartMeasurement {
  struct Patch {
    /// linear light, full scale 1, after correction of response curve and hot pixels
    schemas::Rgb measured{};
    double x = 0, y = 0;     ///< its centre, pixels from the picture's top-left corner
    bool is_exposed = true;  ///< no channel clipped at black or at full scale
  };
  int frames = 0;  ///< in which the chart was found; 0: the other fields are undefined
  rig::PictureSize size;
  std::array<Patch, rig::kChartPatches> patches{};
};

inline constexpr int kMostChartFrames = 5;

/// Returns the mean over at most `most_frames` frames, spread over the take. Uses the curve and the
/// hot pixels of `response`. Throws Error (bad input) for a damaged frame, and (failed) if a stop
/// is requested.
ChartMeasurement measure_chart(const store::Take& take, int camera,
                               const schemas::PhotometricResponse& response,
                               int most_frames = kMostChartFrames,
                               const std::stop_token& stop = {});

/// Returns the measurements of every camera. Throws Error (failed) if a stop is requested.
std::vector<ChartMeasurement> measure_charts(
    const store::Take& take, const std::vector<schemas::PhotometricResponse>& responses,
    const std::stop_token& stop);

}  // namespace raystage::calibrate
