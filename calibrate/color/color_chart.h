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

/// What one camera shows of a ColorChecker Classic: its patches by rows, from dark skin on.
struct ChartMeasurement {
  struct Patch {
    Rgb measured{};          ///< linear light by the camera's curve and dark pixels, full scale 1
    double x = 0, y = 0;     ///< its middle, pixels from the picture's top-left corner
    bool is_exposed = true;  ///< no channel cut off at black or at full scale
  };
  int frames = 0;  ///< in which the chart was found; 0: what follows says nothing
  PictureSize size;
  std::array<Patch, kChartPatches> patches{};
};

/// The mean over at most `most_frames` frames, spread over the take. Of `response` the curve and
/// the dark pixels count. Throws Error (bad input) for a damaged frame.
ChartMeasurement measure_chart(const Take& take, int camera, const PhotometricResponse& response,
                               int most_frames = 5);

/// Of every camera. Throws Error (failed) when a stop is asked for.
std::vector<ChartMeasurement> measure_charts(const Take& take,
                                             const std::vector<PhotometricResponse>& responses,
                                             const std::stop_token& stop);

struct ChartMatchSettings {
  int reference = 0;  ///< camera that the others are made alike to
  /// Not alike to it, but to what the chart is known to reflect, as bright as it shows the greys.
  bool use_published_values = false;
};

/// A matrix for each camera's colours (thesis 4.3: a colour target), by robust least squares over
/// the patches, on top of `responses`, whose matrices are replaced. Of cameras whose response has
/// neither contrast nor brightness, the brightness (black) too. A camera that did not find the
/// chart stays as it is, which nobody can vouch for; nor for one whose patches do not come out
/// right.
ColorMatch match_charts(const std::vector<ChartMeasurement>& measurements,
                        const std::vector<PhotometricResponse>& responses,
                        const std::vector<std::string>& cameras,
                        const ChartMatchSettings& settings);

}  // namespace raystage
