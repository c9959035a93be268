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

namespace raystage {

/// Looks for a board in frames of one camera, `most` of them at most, spread over the take.
/// `progress` gets the part done, in [0, 1]. Throws Error (failed) when a stop is asked for.
std::vector<BoardView> detect_board_views(const Take& take, int camera, const BoardDetector& finder,
                                          int most, const std::function<void(double)>& progress,
                                          const std::stop_token& stop);

/// Follows a board's corners through a take: a track of each, by camera, for interpolate_tracks().
/// Every frame is looked at. Errors and progress as track_light().
PointTracks track_board_corners(const Take& take,
                                const std::vector<std::vector<Nanoseconds>>& times,
                                const BoardDetector& finder,
                                const std::function<void(double)>& progress,
                                const std::stop_token& stop);

}  // namespace raystage
