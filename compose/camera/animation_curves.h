// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <functional>
#include <vector>

namespace raystage {

/// A value that changes with the frame number, which may lie between frames. Null: not given.
template <class V>
using AnimationChannel = std::function<V(double frame)>;

template <class V>
struct CurveKey {
  double frame = 0;
  V value;
};

/// Where a frame lies among keys: on or after `from`, before `to`, `u` of the way; outside the keys
/// on the nearest of them.
struct KeyInterval {
  std::size_t from = 0, to = 0;
  double u = 0;  ///< [0, 1)
};

/// A smooth curve through keys, exactly the key at a key: cubic Hermite, C1 between the first and
/// the last key for any spacing of them, held outside. The slope at an inner key is that of the
/// parabola through it and its neighbours, cut to 1.5 times the slower of the two adjoining means:
/// with keys of very uneven spacing or distance it does not swing out (a point leaves the straight
/// line between two keys by at most 3/8 of their distance), and where two keys are equal it rests
/// between them. A number never leaves the range between two neighbouring keys. At the ends the
/// curve runs straight on (two keys: constant speed); for an ease-in, add a key.
/// V: double or Eigen::Vector3d.
template <class V>
class Curve {
 public:
  /// `keys`: at least one, by rising frame.
  explicit Curve(const std::vector<CurveKey<V>>& keys);
  V operator()(double frame) const;

 private:
  std::vector<double> frames_;
  std::vector<V> values_, slopes_;  ///< slopes: per frame
};

/// The same for rotations: Kim, Kim and Shin, "A general construction scheme for unit quaternion
/// curves", SIGGRAPH 1995, with the shorter way round between neighbouring keys (below 180
/// degrees).
class RotationCurve {
 public:
  /// `keys`: at least one, by rising frame; unit quaternions of either sign.
  explicit RotationCurve(const std::vector<CurveKey<Eigen::Quaterniond>>& keys);
  Eigen::Quaterniond operator()(double frame) const;

 private:
  std::vector<double> frames_;
  std::vector<Eigen::Quaterniond> values_;
  std::vector<Eigen::Vector3d> angular_velocities_;  ///< in the turning frame, radians per frame
};

/// `frames`: rising, at least one.
KeyInterval find_key_interval(const std::vector<double>& frames, double frame);

}  // namespace raystage
