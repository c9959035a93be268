// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <string>
#include <vector>

#include "rig/rig.h"
#include "rig/topology.h"

namespace raystage::rig {

/// The slopes x/-z and y/-z of rays between which a frustum lies, in its own frame.
struct SlopeRange {
  Eigen::Vector2d least = Eigen::Vector2d::Zero();
  Eigen::Vector2d largest = Eigen::Vector2d::Zero();

  /// Returns whether a slope is inside, with a relative tolerance of 1e-12.
  bool contains(const Eigen::Vector2d& slope) const;
  /// Returns the slopes of the four corners, counter-clockwise from the lower left.
  std::vector<Eigen::Vector2d> corners() const;
};

/// Returns the slopes of a symmetric frustum. Angles: full, radians, above 0 and below pi.
SlopeRange symmetric_slopes(double horizontal_fov, double vertical_fov);
/// Returns the slopes of a camera without distortion.
SlopeRange camera_slopes(const schemas::Intrinsics& intrinsics, int width, int height);

/// An ideal array (thesis 5.1): equal cameras without distortion, with parallel axes, in a plane
/// perpendicular to them (wall-eyed). Its frame: origin in the middle of the centres' bounding box,
/// the cameras look along -z, y up as in the cameras.
struct WallEyedArray {
  Pose pose;                          ///< of the frame in the world
  std::vector<Eigen::Vector2d> hull;  ///< convex hull of the centres, metres, counter-clockwise
  SlopeRange slopes;                  ///< that every camera sees

  Eigen::Vector2d size() const;  ///< width and height of the hull, metres
};

/// How far an array may differ from an ideal one.
struct WallEyedTolerance {
  double position = 1e-9;  ///< from the plane, relative to the array's extent
  double rotation = 1e-9;  ///< between cameras, radians
  double slope = 1e-9;     ///< of the borders of the cameras' frusta
};

/// Returns the ideal array that a rig is; nullopt where it is none. `reason`: why, for people.
std::optional<WallEyedArray> find_wall_eyed_array(const Rig& rig,
                                                  const WallEyedTolerance& tolerance = {},
                                                  std::string* reason = nullptr);

/// Returns an ideal array whose rays the cameras of a rig recorded, for real rigs: cameras that are
/// distorted, slightly rotated or not quite in a plane. Its slopes are those that every camera
/// sees, and its hull is smaller where the centres are not in its plane. The rig may have recorded
/// more rays. Nullopt where the cameras see no slopes in common; `reason`: why, for people.
std::optional<WallEyedArray> inscribed_wall_eyed_array(const Rig& rig, const Topology& topology,
                                                       std::string* reason = nullptr);

/// The rays that an array recorded.
struct RecordedArray {
  WallEyedArray array;
  bool is_ideal = false;  ///< otherwise it recorded at least these rays
};
/// Returns the ideal array that a rig is, or else an inscribed one. Nullopt as
/// inscribed_wall_eyed_array(); `reason`: why, for people.
std::optional<RecordedArray> recorded_array(const Rig& rig, std::string* reason = nullptr);

/// Returns the convex hull of points, counter-clockwise, without corners that are within
/// `tolerance` of the edge between their neighbours. Two points: all are on a line; one: they
/// coincide.
std::vector<Eigen::Vector2d> convex_hull(std::vector<Eigen::Vector2d> points, double tolerance);

}  // namespace raystage::rig
