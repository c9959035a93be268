// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "calibrate/color/chart_measurement.h"
#include "calibrate/color/color_match.h"

namespace raystage::calibrate {

struct ChartMatchOptions {
  int reference = 0;  ///< camera that the others are matched to
  /// Matches all cameras to the published colours of the chart, at the brightness of its greys.
  bool use_published_values = false;
};

/// Returns responses with a colour matrix for each camera (thesis 4.3: colour target), by robust
/// least squares over the patches. It replaces the matrix of `responses`, and the brightness
/// (black) of cameras without contrast and brightness. A camera without the chart keeps its
/// response and is rejected, as is one with large residuals.
ColorMatch match_charts(const std::vector<ChartMeasurement>& measurements,
                        const std::vector<schemas::PhotometricResponse>& responses,
                        const std::vector<std::string>& cameras, const ChartMatchOptions& options);

}  // namespace raystage::calibrate
