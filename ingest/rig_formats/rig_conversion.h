// SPDX-License-Identifier: Apache-2.0
// Internal to rig_formats/: what several formats share.
#pragma once

#include <Eigen/Core>
#include <string>
#include <string_view>
#include <vector>

#include "base/error.h"
#include "ingest/rig_formats/rig_format.h"
#include "rig/pose.h"

namespace raystage::ingest {

/// The most cameras of a file; the schemas of JSON formats state it, too.
inline constexpr std::size_t kMaxForeignCameras = 10'000;

/// Returns whether columns are right-handed unit axes within `tolerance`; if so, `axes` is replaced
/// by the nearest rotation. Otherwise `problem` states what they are, and what is allowed.
bool make_rotation(Eigen::Matrix3d& axes, double tolerance, std::string& problem);

/// Returns the pose of a camera that looks along +z with y down, as in OpenCV and COLMAP:
/// x_in_camera = rotation * (x_in_world - position).
rig::Pose pose_from_opencv(const Eigen::Matrix3d& camera_from_world_rotation,
                           const Eigen::Vector3d& position);
/// Returns that rotation of a pose.
Eigen::Matrix3d opencv_camera_from_world_rotation(const rig::Pose& pose);

/// Returns the error of a camera whose lens a format cannot hold.
Error lens_error(const schemas::CameraGeometry& camera, std::string_view why,
                 std::string_view advice);

/// What the files of a format hold beyond lenses and poses.
struct FormatAbilities {
  bool half_angle = false;
};
/// Returns notes about what a rig has and the files do not hold: half angles, line times of rolling
/// shutters, photometric responses, positions in the grid.
std::vector<std::string> losses_of(const schemas::RigDocument& rig, FormatAbilities abilities);

}  // namespace raystage::ingest
