// SPDX-License-Identifier: Apache-2.0
// Derives eyes and views from a camera's state. Stereo eyes are parallel; convergence is a lens
// shift (off-axis projection) of side / convergence x focal length / film back. Constant cost.
#include "compose/camera/camera_state.h"

#include <Eigen/Geometry>
#include <cmath>

namespace raystage::compose {

double CameraState::horizontal_fov() const {
  return 2 * std::atan(film_back_mm / (2 * focal_length_mm));
}

CameraState stereo_eye_state(const CameraState& state, const StereoSettings& stereo, Eye eye) {
  if (eye == Eye::kBoth) return state;
  CameraState result = state;
  const double side = eye == Eye::kLeft ? -stereo.interaxial_m / 2 : stereo.interaxial_m / 2;
  result.pose.position += side * state.pose.world_from_camera_rotation.col(0);
  if (stereo.convergence_m) {
    // Moves a point on the common axis at that distance back to the image centre.
    result.shift_x -= side / *stereo.convergence_m * state.focal_length_mm / state.film_back_mm;
  }
  return result;
}

render::VirtualCamera make_virtual_camera(const CameraState& state, int width, int height) {
  const double focal = width * state.focal_length_mm / state.film_back_mm;
  const double cx = width * (0.5 - state.shift_x), cy = height / 2.0 + width * state.shift_y;
  return {width, height, {focal, focal, cx, cy, {}}, state.pose};
}

Eigen::Matrix3d look_at_rotation(const Eigen::Vector3d& from, const Eigen::Vector3d& target) {
  const Eigen::Vector3d back = (from - target).normalized();
  const Eigen::Vector3d level = Eigen::Vector3d::UnitY().cross(back);
  constexpr double kPole = 1e-9;  // radians from straight up or down
  const Eigen::Vector3d right =
      level.norm() > kPole ? Eigen::Vector3d(level.normalized()) : Eigen::Vector3d::UnitX();
  Eigen::Matrix3d rotation;
  rotation.col(0) = right;
  rotation.col(1) = back.cross(right).normalized();
  rotation.col(2) = back;
  return rotation;
}

}  // namespace raystage::compose
