// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <stop_token>
#include <string>
#include <vector>

#include "calibrate/color/color_match.h"
#include "rig/color_checker.h"
#include "rig/photometric_model.h"
#include "store/take.h"

namespace raystage {

/// Measurement of a ColorChecker Classic by one camera: patches by rows, starting with dark skin.
struct ChartMeasurement {
  struct Patch {
    Rgb measured{};  ///< linear light after the camera's response curve and hot pixels, full scale
                     ///< 1
    double x = 0, y = 0;     ///< its centre, pixels from the picture's top-left corner
    bool is_exposed = true;  ///< no channel clipped at black or at full scale
  };
  int frames = 0;  ///< in which the chart was found; 0: the other fields are undefined
  PictureSize size;
  std::array<Patch, kChartPatches> patches{};
};

/// Returns the mean over at most `most_frames` frames, spread over the take. Uses the curve and the
/// hot pixels of `response`. Throws Error (bad input) for a damaged frame.
ChartMeasurement measure_chart(const Take& take, int camera, const PhotometricResponse& response,
                               int most_frames = 5);

/// Returns the measurements of every camera. Throws Error (failed) if a stop is requested.
std::vector<ChartMeasurement> measure_charts(const Take& take,
                                             const std::vector<PhotometricResponse>& responses,
                                             const std::stop_token& stop);

struct ChartMatchSettings {
  int reference = 0;  ///< camera that the others are matched to
  /// Matches all cameras to the published colours of the chart, at the brightness of its greys.
  bool use_published_values = false;
};

/// Returns a colour matrix for each camera (thesis 4.3: colour target), by robust least squares
/// over the patches, which replaces that of `responses`; also the brightness (black) of cameras
/// without contrast and brightness. A camera without the chart keeps its response. It is rejected,
/// as is one with large residuals.
ColorMatch match_charts(const std::vector<ChartMeasurement>& measurements,
                        const std::vector<PhotometricResponse>& responses,
                        const std::vector<std::string>& cameras,
                        const ChartMatchSettings& settings);

}  // namespace raystage
