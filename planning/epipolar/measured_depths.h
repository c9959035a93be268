// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/time.h"
#include "planning/epipolar/epipolar_image.h"
#include "schemas/geometry.h"
#include "store/take.h"

namespace raystage::planning {

/// How much of a take is looked at.
struct DepthMeasurementOptions {
  int instants = 3;  ///< evenly spaced over the take; at least 1
  int cameras = 16;  ///< of each instant, spread over the array; at least 2

  /// Returns whether the options are in range; otherwise `reason` says what is not.
  bool is_valid(std::string* reason) const;
};

/// The depths of a scene, measured by the slopes of lines in epipolar-plane images.
struct MeasuredDepths {
  std::string take;  ///< its folder
  std::vector<Nanoseconds> instants;
  int cameras = 0;  ///< whose pixels were measured, at most
  /// Inverse distances in front of the array, 1/m, of all measured pixels, sorted; 0 is infinity.
  std::vector<double> inverse_depths;
  /// Contains the depths of the scene; far may be infinite. Nullopt: too few pixels were measured.
  std::optional<schemas::DepthRange> range;
  std::string no_range_because;               ///< for people; empty if there is a range
  double inverse_depth_per_pixel = 0;         ///< 1/m, moves a point by a pixel between neighbours
  std::vector<EpipolarImage> images;          ///< of the first instant, in the middle of the array
  std::optional<schemas::DepthRange> stated;  ///< in the take
};

/// Measures the depths of a take. Throws Error (bad input) for invalid options, a take without
/// frames or with damaged ones, and Error (failed) if stopped. `progress`: called with the share
/// that is done.
MeasuredDepths measure_depths(const store::Take& take, const DepthMeasurementOptions& options,
                              const std::function<void(double)>& progress = {},
                              const std::stop_token& stop = {});

}  // namespace raystage::planning
