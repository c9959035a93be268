// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <stop_token>
#include <vector>

#include "base/time.h"
#include "calibrate/detect/board.h"
#include "calibrate/detect/point_tracks.h"
#include "calibrate/geometry/lens_calibration.h"
#include "store/take.h"

namespace raystage::calibrate {

/// Returns the views of a board in at most `most` frames of one camera, spread over the take. Calls
/// `progress` with the completed share, in [0, 1]. Throws Error (failed) if a stop is requested.
std::vector<BoardView> detect_board_views(const store::Take& take, int camera,
                                          const BoardDetector& finder, int most,
                                          const std::function<void(double)>& progress,
                                          const std::stop_token& stop);

/// Returns a track of each corner of a board per camera, for interpolate_tracks(). Searches every
/// frame. Errors and progress as track_light().
PointTracks track_board_corners(const store::Take& take,
                                const std::vector<std::vector<Nanoseconds>>& times,
                                const BoardDetector& finder,
                                const std::function<void(double)>& progress,
                                const std::stop_token& stop);

}  // namespace raystage::calibrate
