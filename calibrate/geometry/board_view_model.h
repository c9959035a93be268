// SPDX-License-Identifier: Apache-2.0
// Internal to calibrate/geometry: views of boards by cameras at the origin, as a model for the
// bundle adjustment.
#pragma once

#include <cstddef>
#include <span>
#include <vector>

#include "calibrate/geometry/array_model.h"
#include "calibrate/geometry/lens_calibration.h"

namespace raystage::calibrate {

/// The usable views of cameras.
struct BoardViewList {
  std::vector<const BoardView*> views;  // of cameras that must outlive it
  std::vector<std::size_t> camera;      // of each view

  /// Throws Error (bad input) for a camera with fewer than three views of six corners.
  explicit BoardViewList(std::span<const CameraBoardViews> cameras);
};

/// Returns cameras at the origin with these lenses, and a board without a pose for each view.
ArrayModel make_board_view_model(const BoardViewList& views,
                                 std::span<const CameraBoardViews> cameras,
                                 std::span<const schemas::Intrinsics> lenses);

/// Sets the pose of each board from its corners and the lens of its camera.
void place_boards(ArrayModel& model, const BoardViewList& views);

}  // namespace raystage::calibrate
