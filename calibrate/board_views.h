// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <stop_token>
#include <vector>

#include "calibrate/board.h"
#include "calibrate/light_tracks.h"
#include "rig/calibration/board_lens.h"
#include "schemas/time.h"
#include "store/take.h"

namespace raystage {

/// Looks for a board in frames of one camera, `most` of them at most, spread over the take.
/// `progress` gets the part done, in [0, 1]. Throws Error (failed) when a stop is asked for.
std::vector<BoardView> board_views(const Take& take, int camera, const BoardFinder& finder,
                                   int most, const std::function<void(double)>& progress,
                                   const std::stop_token& stop);

/// Follows a board's corners through a take: a track of each, by camera, for light_points(). Every
/// frame is looked at. Errors and progress as track_light().
Tracks track_board(const Take& take, const std::vector<std::vector<Nanoseconds>>& times,
                   const BoardFinder& finder, const std::function<void(double)>& progress,
                   const std::stop_token& stop);

}  // namespace raystage
