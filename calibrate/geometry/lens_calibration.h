// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "calibrate/geometry/lens_projection.h"
#include "rig/camera_model.h"
#include "rig/pose.h"

namespace raystage {

/// One picture of a flat board: where its corners are on it, and where they were seen.
struct BoardView {
  int frame = 0;
  std::vector<Eigen::Vector2d> object_points;  ///< metres; x right, y down the board
  std::vector<Eigen::Vector2d> pixels;         ///< as many; centres at +0.5, y down
};

/// Where a view's board is, as its camera with this lens sees it (camera_from_board: x right and y
/// up on the board); none with fewer than four corners.
std::optional<Pose> estimate_board_pose(const BoardView& view, const CameraModel& lens);

struct LensCalibrationSettings {
  bool full_lens_model = false;  ///< k3 and tangential distortion, too
  double max_error_px = 3;       ///< a corner farther from where it should be does not count
  std::stop_token stop = {};     ///< asks to end it
};

/// A lens as a board shows it.
struct LensCalibration {
  Intrinsics lens;
  LensParameters deviations{};  ///< one standard deviation each; 0: held
  double rms_px = 0;
  int views = 0, corners = 0, outliers = 0;
  double image_coverage = 0;  ///< share of the picture's sixteenths with a corner that counts
  double max_tilt_deg = 0;    ///< of a view's board against the picture's plane
  std::vector<std::string> reasons;     ///< why it is rejected; empty: it is accepted
  std::vector<std::string> next_steps;  ///< what to record
};

/// What one camera saw of a board.
struct CameraBoardViews {
  std::string id;
  int width = 0, height = 0;  ///< pixels
  std::vector<BoardView> views;
};

/// Zhang's method (2000): a first guess of the focal length from the boards' vanishing points, then
/// all views and the lens refined at once, by least squares over the corners. Accepted if the
/// focal length is known to 1 % (two standard deviations) and nine of ten corners fit. Throws Error
/// (bad input) with fewer than three views of six corners.
LensCalibration calibrate_lens(const CameraBoardViews& camera,
                               const LensCalibrationSettings& settings);

/// Of cameras whose lenses are of one kind: all at once, so that what one shows of the lens counts
/// for the others, too; each has a principal point of its own. Rejected if one differs
/// from its own calibration by more than lenses of a make do (kLensPriorDeviations). Errors as
/// calibrate_lens(); (bad input) also for pictures of different sizes.
std::vector<LensCalibration> calibrate_lenses_with_shared_prior(
    std::span<const CameraBoardViews> cameras, const LensCalibrationSettings& settings);

}  // namespace raystage
