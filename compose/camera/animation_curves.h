// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <Eigen/Geometry>
#include <cstddef>
#include <functional>
#include <vector>

namespace raystage::compose {

/// A value as a function of the (fractional) frame number. Null: not given.
template <class V>
using AnimationChannel = std::function<V(double frame)>;

template <class V>
struct CurveKey {
  double frame = 0;
  V value;
};

/// Position of a frame among keys: at or after `from`, before `to`, at the share `u` between them.
/// Outside the keys: on the nearest one.
struct KeyInterval {
  std::size_t from = 0, to = 0;
  double u = 0;  ///< [0, 1)
};

/// Interpolates keys exactly with a cubic Hermite spline: C1 between the first and the last key for
/// any spacing, constant outside. The slope at an inner key is that of the parabola through it and
/// its neighbours. It is limited to 1.5 times the smaller mean slope of the two adjacent intervals,
/// which limits overshoot with uneven keys. A point deviates from the line between two keys by at
/// most 3/8 of their distance; between equal keys the curve is constant. A number never leaves the
/// range of two adjacent keys. The acceleration at both ends is 0 (two keys: constant speed); for
/// an ease-in, add a key. V: double or Eigen::Vector3d.
template <class V>
class Curve {
 public:
  /// Computes the curve. `keys`: at least one, ascending frames.
  explicit Curve(const std::vector<CurveKey<V>>& keys);
  V operator()(double frame) const;

 private:
  std::vector<double> frames_;
  std::vector<V> values_, slopes_;  ///< slopes: change per frame
};

/// Interpolates rotations likewise, by the smaller angle between adjacent keys: Kim, Kim and Shin,
/// "A general construction scheme for unit quaternion curves", SIGGRAPH 1995.
class RotationCurve {
 public:
  /// Computes the curve. `keys`: at least one, ascending frames; unit quaternions of either sign.
  explicit RotationCurve(const std::vector<CurveKey<Eigen::Quaterniond>>& keys);
  Eigen::Quaterniond operator()(double frame) const;

 private:
  std::vector<double> frames_;
  std::vector<Eigen::Quaterniond> values_;
  std::vector<Eigen::Vector3d> angular_velocities_;  ///< in the rotating frame, radians per frame
};

/// Returns the position of `frame` among `frames` (ascending, at least one).
KeyInterval find_key_interval(const std::vector<double>& frames, double frame);

}  // namespace raystage::compose
