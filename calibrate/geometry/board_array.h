// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calibrate/geometry/detections.h"
#include "calibrate/geometry/lens_calibration.h"
#include "calibrate/geometry/solve.h"

namespace raystage::calibrate {

/// Corner positions on a flat board; all boards of a recording are equal.
using BoardObjectPoints = std::vector<Eigen::Vector2d>;  ///< metres on the board; x right, y down

/// Returns the board views of one camera. Points of the detections are numbered instant *
/// corners.size() + corner.
std::vector<BoardView> collect_board_views(const Detections& detections, int camera,
                                           const BoardObjectPoints& corners);

/// Calibrates an array from a board that several cameras observe at once. Lenses that are not given
/// come from Zhang's method (one for all, or one per camera). The pose of each view comes from its
/// corners; cameras are placed by the boards that they share. One bundle adjustment over cameras,
/// lenses and boards follows, in which each board moves as a rigid body. World units are metres.
/// Throws Error (bad input) if no two cameras share a board. Cameras that share none with the
/// others have no pose.
ArrayModel solve_boards(const Detections& detections, const BoardObjectPoints& corners,
                        const SolveOptions& options, SolveReport& report);

}  // namespace raystage::calibrate
