// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <optional>
#include <string>

namespace raystage::schemas {

/// A 4x4 matrix, row-major, for column vectors (translation in the last column).
using Matrix4 = std::array<double, 16>;

/// Brown-Conrady distortion on normalised image coordinates (x/z, y/z, y down), as in OpenCV.
struct Distortion {
  double k1 = 0, k2 = 0, p1 = 0, p2 = 0, k3 = 0;  ///< unitless
  bool operator==(const Distortion&) const = default;
};

/// How a lens maps the angle between a ray and the optical axis to a distance from the principal
/// point, in focal lengths: the tangent (kPinhole), the angle (kFisheye, which is OpenCV's word,
/// and kFtheta), 2 sin(angle / 2) (kEquisolid) or sin(angle) (kOrthographic).
enum class Projection { kPinhole, kFisheye, kFtheta, kEquisolid, kOrthographic };

/// Intrinsics in pixels. Image origin at the top-left corner of the top-left pixel, y down, pixel
/// centres at +0.5.
struct Intrinsics {
  double fx = 1, fy = 1, cx = 0, cy = 0;
  Distortion distortion;  ///< of a pinhole
  Projection projection = Projection::kPinhole;
  /// Of other projections: factors of r^3, r^5, r^7 and r^9, which are added to the distance r.
  std::array<double, 4> radial_distortion{};
  /// Of other projections: largest angle of a recorded ray to the optical axis, radians, up to pi;
  /// nullopt: as far as the projection reaches.
  std::optional<double> half_angle = std::nullopt;
  bool operator==(const Intrinsics&) const = default;
};

/// A camera. `world_from_camera` is rigid, in metres: camera x right, y up, looks down -z.
struct CameraGeometry {
  std::string id;
  int width = 0, height = 0;  ///< pixels
  Intrinsics intrinsics;
  Matrix4 world_from_camera{1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
  std::optional<int> row, column;  ///< position in the grid; nullopt: none
  /// Time from the exposure of a row to that of the row below, microseconds; negative: from the
  /// bottom up; 0: global shutter.
  double line_time_us = 0;
  bool operator==(const CameraGeometry&) const = default;
};

/// Nearest and farthest distance of the scene in front of the array, metres; far may be infinite.
struct DepthRange {
  double near = 0, far = 0;
  bool operator==(const DepthRange&) const = default;
};

}  // namespace raystage::schemas
