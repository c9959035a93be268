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

/// How a motion slows down near a key: factors of its speed there, [0, 1]. 1: it does not slow
/// down; 0: it stops.
struct KeySpeed {
  double arriving = 1, leaving = 1;
};

template <class V>
struct CurveKey {
  double frame = 0;
  V value;
  KeySpeed speed = {};
};

/// Position of a frame among keys: at or after `from`, before `to`, at the share `u` between them.
/// Outside the keys: on the nearest one.
struct KeyInterval {
  std::size_t from = 0, to = 0;
  double u = 0;  ///< [0, 1)
};

/// The derivatives of a curve just before and just after a key.
template <class V>
struct KeySlopes {
  V arriving, leaving;
};

/// Interpolates keys exactly with a cubic Hermite spline: C1 between the first and the last key for
/// any spacing, constant outside. The slope at an inner key is that of the parabola through it and
/// its neighbours. It is limited to 1.5 times the smaller mean slope of the two adjacent intervals,
/// which limits overshoot with uneven keys. A point deviates from the line between two keys by at
/// most 3/8 of their distance; between equal keys the curve is constant. A number never leaves the
/// range of two adjacent keys. The acceleration at both ends is 0 (two keys: constant speed). Where
/// a key has a KeySpeed, the slopes of the curve before and after it are multiplied by its factors;
/// if these differ, the curve is only continuous there. V: double or Eigen::Vector3d.
template <class V>
class Curve {
 public:
  /// Computes the curve. `keys`: at least one, ascending frames.
  explicit Curve(const std::vector<CurveKey<V>>& keys);
  V operator()(double frame) const;

 private:
  std::vector<double> frames_;
  std::vector<V> values_;
  std::vector<KeySlopes<V>> slopes_;  ///< change per frame
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
  /// In the rotating frame, radians per frame.
  std::vector<KeySlopes<Eigen::Vector3d>> angular_velocities_;
};

/// Returns the position of `frame` among `frames` (ascending, at least one).
KeyInterval find_key_interval(const std::vector<double>& frames, double frame);

}  // namespace raystage::compose
