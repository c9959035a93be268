// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <string>

#include "compose/camera/animation_curves.h"
#include "schemas/shot_document.h"

namespace raystage {

/// What moves a camera, each by itself; null: not given.
struct CameraChannels {
  AnimationChannel<Eigen::Vector3d> position;        ///< world, metres
  AnimationChannel<Eigen::Quaterniond> orientation;  ///< world_from_camera
  AnimationChannel<Eigen::Vector3d>
      target;                      ///< looked at, in place of an orientation; world, metres
  AnimationChannel<double> roll;   ///< radians about the axis, clockwise for who looks through
  AnimationChannel<double> focal;  ///< focal length in half picture widths: 1 / tan(fov / 2)
  AnimationChannel<double> focus;  ///< metres along the axis
  AnimationChannel<double> f_number, shutter;  ///< shutter: degrees
  AnimationChannel<double> orbit;              ///< radians about the shot's orbit axis
};

/// Each property a smooth curve through the keys that have it. Focal length is what is
/// interpolated, not the angle: in a dolly zoom focal length and distance stay proportional, so the
/// subject keeps its size. Throws Error (bad input), with `where` in it, for keys that do not rise,
/// are not finite, or say the same thing twice.
CameraChannels channels_from_keys(const ShotDocument::Camera& camera, const std::string& where);

/// `first` with what it lacks from `second`. Throws Error (bad input) where both give the same.
CameraChannels merge_channels(CameraChannels first, const CameraChannels& second,
                              const std::string& where);

}  // namespace raystage
