// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "rig/planning/convex_polyhedron.h"
#include "rig/planning/wall_eyed_array.h"

namespace raystage::rig {

/// The rays of a virtual camera, without its position.
struct ViewFrustum {
  SlopeRange slopes;
  Eigen::Matrix3d world_from_camera_rotation = Eigen::Matrix3d::Identity();
  double interaxial = 0;  ///< metres between two eyes along the camera's x axis; 0: one eye
};

/// The positions from which every ray of a view was recorded. Rows of cameras record rays in one
/// plane only: their range is that of cameras with one row of pixels (thesis 5.2.1, 2-D cameras),
/// flat; that of a single centre is the centre.
struct RangeOfMotion {
  ConvexPolyhedron positions;  ///< in the array's frame; of a stereo camera: between its eyes
  int dimension = 3;           ///< of `positions`: 3, 2 for a row, 0 for a single centre
  std::string empty_because;   ///< why there is no position, for people; empty if there are some
};

/// Returns the range of motion of a view before an ideal array (thesis 5.2, 7.2). It is a convex
/// polyhedron: every extreme ray must cross the array's hull, and its slope must be one that the
/// cameras see. Slopes do not depend on the position, and where a ray crosses the array is linear
/// in it. `frustum`: every ray must point to where the cameras look, else there is no position.
RangeOfMotion range_of_motion(const WallEyedArray& array, const ViewFrustum& frustum);

/// Returns the positions from which every ray to a subject was recorded (thesis 5.4: only rays that
/// meet the subject count). `subject`: the corners of its convex hull in the array's frame, in
/// front of the array. The positions are those behind the nearest corner, up to `farthest` metres
/// (above 0) behind the array.
RangeOfMotion range_of_motion_around(const WallEyedArray& array,
                                     std::span<const Eigen::Vector3d> subject, double farthest);

}  // namespace raystage::rig
