// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <optional>
#include <span>
#include <utility>
#include <vector>

#include "schemas/geometry.h"

namespace raystage::rig {

/// A virtual camera in the frame of an array whose cameras look along -z from z = 0. Positive yaw
/// turns it to the left, positive pitch upwards.
struct PlannedView {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();  ///< metres; z < 0 is in front of the array
  std::pair<double, double> yaw{0, 0}, pitch{0, 0};    ///< least and largest, radians
};

/// The picture of the virtual cameras.
struct PlannedPicture {
  double horizontal_fov = 0;  ///< full angle, radians
  double aspect = 1;          ///< width / height
  double interaxial = 0;      ///< metres between the eyes of a stereo camera; 0: one eye
};

/// What an array must have so that every ray of some views is recorded by parallel cameras.
struct ArrayRequirements {
  double horizontal_fov = 0, vertical_fov = 0;  ///< of the cameras, full angles, radians
  Eigen::AlignedBox2d extent;                   ///< of their positions in the plane, metres
};

/// Returns the requirements of views (thesis 6.1.2): the cameras' field of view is that of the
/// views and twice their rotation (eq. 6.1), exact for views that turn in one direction, and the
/// extent is where their extreme rays cross the plane of the array (figure 6-3). The same holds for
/// all positions in the convex hull of views that turn alike, because the crossing is linear in the
/// position. Nullopt if a ray does not point to where the cameras look.
std::optional<ArrayRequirements> array_requirements(std::span<const PlannedView> views,
                                                    const PlannedPicture& picture);

/// Returns the largest spacing, metres, at which a scene has at most `error` pixels of ghosting on
/// the best focal plane (thesis eq. 6.5 is for one pixel); infinite for a flat scene. `pitch`: size
/// of a pixel at focal length 1.
double largest_spacing(double pitch, schemas::DepthRange scene, double error);
/// Returns the ghosting in pixels at a spacing: the inverse of largest_spacing().
double ghosting_at_spacing(double pitch, schemas::DepthRange scene, double spacing);

/// Returns the full angle, radians, that cameras need which are rotated towards the middle of a
/// sphere: from everywhere in `extent` they see all of it. The sphere is in front of the middle of
/// `extent`; `depth`: of its middle, metres. Nullopt if a camera is inside of it.
std::optional<double> fov_of_rotated_cameras(const Eigen::AlignedBox2d& extent, double depth,
                                             double radius);

}  // namespace raystage::rig
