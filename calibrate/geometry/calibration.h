// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calibrate/geometry/board_array.h"
#include "calibrate/geometry/calibration_verdict.h"
#include "calibrate/geometry/line_times.h"
#include "calibrate/geometry/world_frame.h"
#include "schemas/rig_document.h"

namespace raystage::calibrate {

struct CalibrationOptions {
  SolveOptions solve;  ///< lenses, poses and held cameras come from `start` if it is given
  ScaleOptions scale;
  /// Initial rig, with cameras of the detections by id. Its scale is used if no other is given, and
  /// its world frame is kept.
  std::optional<schemas::RigDocument> start = {};
  /// If the points are corners of a board: their positions (board_array.h), which determine the
  /// scale.
  BoardObjectPoints board = {};
  /// Cameras whose poses are held at those of `start`, by id.
  std::vector<std::string> fixed_cameras = {};
  bool fixes_all_poses = false;
  AcceptanceLimits limits = {};
};

/// Result of a calibration with its verdict.
struct Calibration {
  ArrayModel model;  ///< world: the array's axes, or the start's; metres where `scale_is_known`
  SolveReport solve;
  std::optional<Uncertainty> uncertainty;
  bool scale_is_known = false;
  std::string scale_source;  ///< "spacing", "distance", "board", "start", "held cameras" or empty
  int merged_points = 0;     ///< positions of a resting light that were merged
  std::optional<std::vector<std::optional<GridPosition>>> grid;
  LineTimes line_times;  ///< from a moving light; empty: those of the start remain
  CalibrationVerdict verdict;
};

/// Calibrates an array and judges the result. Throws Error (bad input) if no camera can be
/// calibrated, or if the settings name unknown cameras.
Calibration calibrate(const Detections& detections, const CalibrationOptions& options);

/// Returns the calibrated cameras. Photometric responses and grid positions come from `start`;
/// without it, from the calibration. Line times are those of the calibration, or of `start`. Throws
/// Error (bad input) if no camera is calibrated.
schemas::RigDocument make_rig_document(const Calibration& calibration,
                                       const std::optional<schemas::RigDocument>& start,
                                       const std::string& name);

/// Merges frames in which the light rests: those within `max_distance_px` of an earlier one in
/// every camera that observes both become one point. Repeated positions would make the uncertainty
/// too small. Returns the number of removed points.
int merge_static_points(Detections& detections, double max_distance_px = 0.75);

}  // namespace raystage::calibrate
