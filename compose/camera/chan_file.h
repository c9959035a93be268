// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace raystage {

/// In which order the three angles of a .chan file are applied: the first one first. Nuke's cameras
/// have kZxy unless told.
enum class RotationOrder { kXyz, kXzy, kYxz, kYzx, kZxy, kZyx };

/// "ZXY" and its like; none: no such order.
std::optional<RotationOrder> parse_rotation_order(std::string_view name);

/// A line of a .chan file: Nuke's camera at a frame, x right, y up, looking down -z.
struct ChanLine {
  double frame = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< world_from_camera
  std::optional<double> vertical_fov;                               ///< full angle, radians
};

/// Reads lines of "frame tx ty tz rx ry rz [vertical field of view]", degrees, apart by spaces or
/// tabs; lines that are empty or begin with # are passed over. `name` stands for the file in
/// errors. Throws Error (bad input) with the line's number: frames that do not rise, other than 7
/// or 8 numbers, the same number of them in all lines, something that is no finite number, a field
/// of view outside (0, 180), no line at all.
std::vector<ChanLine> parse_chan(std::string_view text, RotationOrder order, std::string_view name);

/// The same text for the same lines; angles go on from line to line without jumps of 360 degrees,
/// and doubles come back to the last bits that sines and cosines leave.
std::string format_chan(const std::vector<ChanLine>& lines, RotationOrder order);

/// Angles x, y, z in radians, applied in the order's order.
Eigen::Quaterniond rotation_from_angles(const Eigen::Vector3d& angles, RotationOrder order);
/// The angles of a rotation that are nearest to `before`.
Eigen::Vector3d angles_from_rotation(const Eigen::Quaterniond& rotation, RotationOrder order,
                                     const Eigen::Vector3d& before);

}  // namespace raystage
