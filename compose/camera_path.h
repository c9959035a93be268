// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <span>
#include <vector>

#include "render/view/view.h"
#include "schemas/shot_document.h"

namespace raystage {

/// The motion of a virtual camera through its keys, at any fractional frame. Exactly the key at a
/// key; one key stands still; before the first and after the last key the camera rests on it.
///
/// Position, rotation and focal length are cubic Hermite curves over time, C1 between the first and
/// the last key for any spacing of the keys. The speed at an inner key is that of the parabola
/// through it and its neighbours, cut to 1.5 times the slower of the two adjoining means: with keys
/// of very uneven spacing or distance the camera does not swing out (it leaves the straight line
/// between two keys by at most 3/8 of their distance), and where two keys are equal it rests
/// between them. At the ends the curve runs straight on (two keys: constant speed); for an ease-in,
/// add a key.
/// Rotation: Kim, Kim and Shin, "A general construction scheme for unit quaternion curves",
/// SIGGRAPH 1995, with the shorter way round between neighbouring keys (below 180 degrees).
/// Focal length (not angle): in a dolly zoom focal length and distance stay proportional, so the
/// subject keeps its size. It never leaves the range between two neighbouring keys.
class CameraPath {
 public:
  /// Throws Error (bad input) without a key, with keys that do not rise, a zero quaternion or an
  /// angle outside (0, 180) degrees.
  explicit CameraPath(std::span<const ShotDocument::CameraKey> keys);

  Pose pose(double frame) const;
  /// Full angle, radians.
  double horizontal_fov(double frame) const;
  VirtualCamera camera(double frame, int width, int height) const;

 private:
  struct Key {
    double frame = 0;
    Eigen::Vector3d position;
    Eigen::Quaterniond orientation;
    double focal = 1;          ///< in half image widths: 1 / tan(fov / 2)
    Eigen::Vector3d velocity;  ///< metres per frame
    Eigen::Vector3d spin;      ///< body frame, radians per frame
    double zoom = 0;           ///< change of `focal` per frame
  };
  struct Place {
    const Key *from = nullptr, *to = nullptr;
    double u = 0;  ///< in [0, 1]
  };
  Place locate(double frame) const;

  std::vector<Key> keys_;
};

}  // namespace raystage
