// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>
#include <span>
#include <string>
#include <vector>

#include "rig/pose.h"

namespace raystage::planning {

/// What a motion control rig can do: an arm on a track (thesis 7.3.2). Infinite: no limit.
struct MotionLimits {
  double reach = std::numeric_limits<double>::infinity();            ///< of the arm, metres
  double extension_speed = std::numeric_limits<double>::infinity();  ///< of the arm, m/s
  double track_speed = std::numeric_limits<double>::infinity();      ///< m/s
  double acceleration = std::numeric_limits<double>::infinity();     ///< m/s^2
  double turn_speed = std::numeric_limits<double>::infinity();       ///< radians/s

  bool is_limited() const;  ///< returns whether there is any limit
};

/// Returns the limits of the Milo Motion Control System that the thesis states (7.3.2).
MotionLimits milo_motion_limits();

/// The pose of a camera at a frame.
struct FramePose {
  int frame = 0;
  rig::Pose pose;
};

/// The largest value of a path, and where it is.
struct PathExtreme {
  double value = 0;
  int frame = 0;
};

/// How a camera moves over adjacent frames. The track of a rig that follows it is the direction in
/// which its positions extend most.
struct CameraMotion {
  double track_length = 0;  ///< metres
  /// Across the track, metres: twice the largest distance from the mean position.
  double reach = 0;
  PathExtreme track_speed;      ///< m/s
  PathExtreme extension_speed;  ///< across the track, m/s
  PathExtreme acceleration;     ///< m/s^2
  PathExtreme turn_speed;       ///< radians/s
};

/// Measures a path by differences of adjacent frames; frames that do not follow each other are not
/// compared. `poses`: by frame, at least one; `fps`: above 0.
CameraMotion measure_motion(std::span<const FramePose> poses, double fps);

/// Less is no motion but the rounding of positions: m, m/s, m/s^2 and radians/s.
inline constexpr double kLeastMotion = 1e-6;

/// Returns a sentence for each limit that a path exceeds; empty if a rig can follow it.
std::vector<std::string> exceeded_limits(const CameraMotion& motion, const MotionLimits& limits);

}  // namespace raystage::planning
