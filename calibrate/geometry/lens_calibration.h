// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "calibrate/geometry/lens_parameters.h"
#include "calibrate/geometry/lens_start.h"
#include "rig/camera_model.h"
#include "rig/pose.h"

namespace raystage::calibrate {

/// Corners of a flat board in one picture.
struct BoardView {
  int frame = 0;
  std::vector<Eigen::Vector2d> object_points;  ///< on the board, metres; x right, y down
  std::vector<Eigen::Vector2d> pixels;         ///< as many; centres at +0.5, y down
};

/// Returns the pose of the board in the camera (camera_from_board: x right and y up on the board);
/// none with fewer than four corners. A fisheye may see the board to its side or behind it.
std::optional<rig::Pose> estimate_board_pose(const BoardView& view, const rig::CameraModel& lens);

struct LensCalibrationOptions {
  LensModel model = {};          ///< kind of the lens
  bool full_lens_model = false;  ///< also the terms after k1 and k2, and fy
  double max_error_px = 3;       ///< corners with a larger reprojection error are outliers
  std::stop_token stop = {};     ///< stops it
  bool is_valid(std::string* reason) const;
};

/// Result of the calibration of one lens.
struct LensCalibration {
  schemas::Intrinsics lens;
  LensParameters deviations{};  ///< one standard deviation each; 0: held
  double rms_px = 0;
  int views = 0, corners = 0, outliers = 0;
  /// share of the cells of a 4x4 grid over the picture that have an inlier
  double image_coverage = 0;
  /// largest tilt of a board: of a pinhole, against the image plane; of a fisheye, which sees
  /// boards to its side, against the plane that faces the camera at the board's middle
  double max_tilt_deg = 0;
  std::vector<std::string> reasons;     ///< why it is rejected; empty: it is accepted
  std::vector<std::string> next_steps;  ///< what to record
};

/// Board views of one camera.
struct CameraBoardViews {
  std::string id;
  int width = 0, height = 0;  ///< pixels
  std::vector<BoardView> views;
};

/// Calibrates a lens by Zhang's method (2000). The initial focal length comes from the vanishing
/// points of the boards, of a fisheye from trials of several; then all poses and the lens are
/// refined jointly by least squares over the corners. Accepted if the focal length is known to 1 %
/// (two standard deviations) and nine of ten corners fit. Throws Error (bad input) with fewer than
/// three views of six corners.
LensCalibration calibrate_lens(const CameraBoardViews& camera,
                               const LensCalibrationOptions& options);

/// Calibrates lenses of one model jointly with a shared lens prior; each has its own principal
/// point. Rejected if a lens differs from its independent calibration by more than
/// kLensPriorDeviations allow. Errors as calibrate_lens(); (bad input) also for pictures of
/// different sizes.
std::vector<LensCalibration> calibrate_lenses_with_shared_prior(
    std::span<const CameraBoardViews> cameras, const LensCalibrationOptions& options);

}  // namespace raystage::calibrate
