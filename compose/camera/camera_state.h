// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "render/common/view.h"
#include "rig/pose.h"

namespace raystage::compose {

/// The eye of a stereo pair.
enum class Eye { kBoth, kLeft, kRight };

/// A shot's camera at one frame.
struct CameraState {
  rig::Pose pose;
  double film_back_mm = 36;  ///< width
  double focal_length_mm = 50;
  /// Lens shift in film back widths: the picture's centre is to the right of the axis, and above
  /// it.
  double shift_x = 0, shift_y = 0;
  std::optional<double> focus_m;      ///< along the optical axis
  std::optional<double> f_number;     ///< none: a pinhole
  std::optional<double> shutter_deg;  ///< shutter angle; 360: open for the whole frame time

  double horizontal_fov() const;  ///< full angle without the shift, radians
};

/// Two parallel cameras side by side. They are never toed in, which would cause vertical disparity.
struct StereoSettings {
  double interaxial_m = 0.065;
  /// Distance of zero disparity, set by lens shift; none: infinity, without shift.
  std::optional<double> convergence_m;
};

/// Returns the state of one eye; for kBoth `state` itself.
CameraState stereo_eye_state(const CameraState& state, const StereoSettings& stereo, Eye eye);

/// Returns the camera of a view of this size, with square pixels.
render::VirtualCamera make_virtual_camera(const CameraState& state, int width, int height);

/// Returns world_from_camera of a camera at `from` that looks at `target` with its x axis level.
/// Looking straight up or down, x is the world's x axis.
Eigen::Matrix3d look_at_rotation(const Eigen::Vector3d& from, const Eigen::Vector3d& target);

}  // namespace raystage::compose
