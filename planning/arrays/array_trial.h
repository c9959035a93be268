// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "planning/arrays/array_plan.h"

namespace raystage::planning {

/// Errors that were measured with a simulated array that stands for a planned one. It has at most 8
/// x 8 cameras of 320 x 240 pixels, and a spacing with which neighbouring cameras see the same
/// differences of disparity, in pixels of the view, as those of the planned array.
struct ArrayTrial {
  std::size_t alternative = 0;              ///< in ArrayPlan::alternatives
  int columns = 0, rows = 0;                ///< that were simulated
  double spacing = 0;                       ///< that was simulated, metres
  double ghosting_px = 0;                   ///< of the simulated array
  double predicted_db = 0;                  ///< of focal_plane, by predicted_focal_plane_db()
  double focal_plane_db = 0, depth_db = 0;  ///< PSNR, measured, mean of the views
  /// The planned array has more cameras or pixels than the simulated one.
  bool is_extrapolated = false;
};

/// Simulates arrays for some alternatives and measures `focal_plane` and `depth`. Leaves out those
/// with a single camera, without ghosting, or with more than 16 pixels of it. Throws
/// Error (failed) if stopped. `progress`: called with the share that is done.
std::vector<ArrayTrial> try_arrays(const ArrayPlan& plan,
                                   const std::vector<std::size_t>& alternatives,
                                   const std::string& created_by,
                                   const std::function<void(double)>& progress = {},
                                   const std::stop_token& stop = {});

/// Returns the PSNR, dB, that focal_plane is expected to have in the simulator's static stage at a
/// ghosting (thesis eq. 2.1). docs/benchmarks.md has the measurements.
double predicted_focal_plane_db(double ghosting_px);

}  // namespace raystage::planning
