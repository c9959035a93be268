// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>
#include <vector>

#include "calibrate/geometry/board_array.h"
#include "calibrate/geometry/calibration_verdict.h"
#include "calibrate/geometry/world_frame.h"
#include "schemas/rig_document.h"

namespace raystage {

struct CalibrationSettings {
  SolveSettings solve;  ///< lenses, poses and held cameras come from `start` where that is given
  ScaleSettings scale;
  /// A rig to begin with: cameras are the detections' by id. Where nothing else tells it, the scale
  /// is the rig's, too, and the world stays where the rig has it.
  std::optional<RigDocument> start = {};
  /// Where the points are corners of a board: which (board_array.h); they tell the scale.
  BoardObjectPoints board = {};
  /// Cameras whose poses stay as `start` has them, by id.
  std::vector<std::string> fixed_cameras = {};
  bool fixes_all_poses = false;
  AcceptanceLimits limits = {};
};

/// All that a calibration found, and how far it can be trusted.
struct Calibration {
  ArrayModel model;  ///< world: the array's axes, or the start's; metres where `scale_is_known`
  SolveReport solve;
  std::optional<Uncertainty> uncertainty;
  bool scale_is_known = false;
  std::string scale_source;  ///< "spacing", "distance", "board", "start", "held cameras" or empty
  int merged_points = 0;     ///< the light stood still: counted once
  std::optional<std::vector<std::optional<GridPosition>>> grid;
  CalibrationVerdict verdict;
};

/// From detections to a judged array. Throws Error (bad input) where nothing can be found at all,
/// and for settings that name unknown cameras.
Calibration calibrate(const Detections& detections, const CalibrationSettings& settings);

/// The cameras that were found, with photometric response and places in the grid as `start` has
/// them, or as they were found. Throws Error (bad input) where none was.
RigDocument make_rig_document(const Calibration& calibration,
                              const std::optional<RigDocument>& start, const std::string& name);

/// Frames in which the light stood where it did in an earlier one, to `max_distance_px` in every
/// camera that saw both, are one point: counted as many they would make everything look surer than
/// it is. Returns how many went.
int merge_static_points(Detections& detections, double max_distance_px = 0.75);

}  // namespace raystage
