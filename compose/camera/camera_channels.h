// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <string>

#include "compose/camera/animation_curves.h"
#include "schemas/shot_document.h"

namespace raystage::compose {

/// The animated properties of a camera, each with its own curve; null: not given.
struct CameraChannels {
  AnimationChannel<Eigen::Vector3d> position;        ///< world, metres
  AnimationChannel<Eigen::Quaterniond> orientation;  ///< world_from_camera
  /// Point that the camera looks at, instead of an orientation; world, metres.
  AnimationChannel<Eigen::Vector3d> target;
  AnimationChannel<double> roll;   ///< radians about the optical axis, clockwise as the camera sees
  AnimationChannel<double> focal;  ///< focal length in half image widths: 1 / tan(fov / 2)
  AnimationChannel<double> shift_x, shift_y;   ///< lens shift, film back widths
  AnimationChannel<double> focus;              ///< metres along the optical axis
  AnimationChannel<double> f_number, shutter;  ///< shutter: degrees
  AnimationChannel<double> orbit;              ///< radians about the shot's orbit axis
};

/// Returns curves through the keys that have each property. The focal length is interpolated, not
/// the angle: in a dolly zoom, focal length and distance stay proportional, so that the subject
/// keeps its size. `where`: named by errors. Throws Error (bad input) for frames that are not
/// ascending, values that are not finite, or a property that is given twice.
CameraChannels channels_from_keys(const schemas::ShotDocument::Camera& camera,
                                  const std::string& where);

/// Returns the channels of both. Throws Error (bad input) if both have the same one.
CameraChannels merge_channels(CameraChannels first, const CameraChannels& second,
                              const std::string& where);

}  // namespace raystage::compose
