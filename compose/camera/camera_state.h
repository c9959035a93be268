// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>

#include "render/common/view.h"
#include "rig/pose.h"

namespace raystage {

/// Which eye of a stereo pair a picture is for.
enum class Eye { kBoth, kLeft, kRight };

/// A shot's camera at one moment, as a photographer sets it.
struct CameraState {
  Pose pose;
  double film_back_mm = 36;  ///< width
  double focal_length_mm = 50;
  /// The lens moved sideways: the picture's middle looks this part of the film back's width to the
  /// right of the axis.
  double shift = 0;
  std::optional<double> focus_m;      ///< along the axis
  std::optional<double> f_number;     ///< none: a pinhole
  std::optional<double> shutter_deg;  ///< part of a frame's time that the shutter is open, of 360

  double horizontal_fov() const;  ///< full angle without the shift, radians
};

/// Two cameras side by side, looking the same way (never turned in: that would tilt their pictures
/// against each other).
struct StereoSettings {
  double interaxial_m = 0.065;
  /// Distance at which both see a point at the same place, by shifted lenses; none: infinity,
  /// parallel axes.
  std::optional<double> convergence_m;
};

/// The state of one eye; of kBoth the state itself.
CameraState stereo_eye_state(const CameraState& state, const StereoSettings& stereo, Eye eye);

/// Square pixels.
VirtualCamera make_virtual_camera(const CameraState& state, int width, int height);

/// Looks from one point at another with its x axis level: y is up as far as that allows. Straight
/// up or down, where no axis is nearer to level than others, x stays the world's.
Eigen::Matrix3d look_at_rotation(const Eigen::Vector3d& from, const Eigen::Vector3d& target);

}  // namespace raystage
