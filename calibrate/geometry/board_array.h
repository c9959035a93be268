// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <vector>

#include "calibrate/geometry/detections.h"
#include "calibrate/geometry/lens_calibration.h"
#include "calibrate/geometry/solve.h"

namespace raystage {

/// What a flat board's corners are: the same on every board that was seen.
using BoardObjectPoints = std::vector<Eigen::Vector2d>;  ///< metres on the board; x right, y down

/// Views of one camera: detections' points are numbered instant * corners.size() + corner.
std::vector<BoardView> collect_board_views(const Detections& detections, int camera,
                                           const BoardObjectPoints& corners);

/// Finds an array from a board that several cameras saw at once: a lens for all, or for each, by
/// Zhang's method where it is not given; each view's pose by its corners; cameras placed by the
/// boards they share; then one bundle adjustment over cameras, lenses and boards, each of which
/// moves as a whole. The world has metres. Throws Error (bad input) where no two cameras share a
/// board. Cameras that share none with the others have no pose.
ArrayModel solve_boards(const Detections& detections, const BoardObjectPoints& corners,
                        const SolveSettings& settings, SolveReport& report);

}  // namespace raystage
