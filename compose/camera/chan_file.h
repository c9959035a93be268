// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <array>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace raystage::compose {

/// The order in which the three angles of a .chan file are applied, the first letter first. kZxy is
/// the default of Nuke's cameras.
enum class RotationOrder { kXyz, kXzy, kYxz, kYzx, kZxy, kZyx };

/// Returns the order with a name such as "ZXY", or nullopt.
std::optional<RotationOrder> parse_rotation_order(std::string_view name);

/// A line of a .chan file: Nuke's camera at a frame; x right, y up, looking down -z.
struct ChanLine {
  double frame = 0;
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  Eigen::Quaterniond orientation = Eigen::Quaterniond::Identity();  ///< world_from_camera
  std::optional<double> vertical_fov;                               ///< full angle, radians
};

/// Reads lines of "frame tx ty tz rx ry rz [vertical field of view]", angles in degrees, separated
/// by spaces or tabs. Ignores empty lines and lines that begin with #. `name`: of the file, for
/// errors. Throws Error (bad input) with the line number if frames are not ascending, or a line
/// does not have 7 or 8 numbers, as many as the others. It does so, too, if a number is not finite,
/// a field of view is outside (0, 180), or there is no line.
std::vector<ChanLine> parse_chan(std::string_view text, RotationOrder order, std::string_view name);

/// Returns the lines as text, deterministically. Angles have no jumps of 360 degrees between lines.
/// Numbers are exact, except for the rounding of sines and cosines.
std::string format_chan(const std::vector<ChanLine>& lines, RotationOrder order);

/// Returns the rotation of angles about x, y and z (radians), applied in this order.
Eigen::Quaterniond rotation_from_angles(const Eigen::Vector3d& angles, RotationOrder order);
/// Returns those angles of a rotation (radians) that are nearest to `before`.
Eigen::Vector3d angles_from_rotation(const Eigen::Quaterniond& rotation, RotationOrder order,
                                     const Eigen::Vector3d& before);

}  // namespace raystage::compose
