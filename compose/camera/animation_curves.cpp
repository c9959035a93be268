// SPDX-License-Identifier: Apache-2.0
// Interpolates keys of numbers, positions and rotations. Numbers and positions: cubic Hermite
// splines whose slopes follow the parabola through three keys, limited against overshoot (Fritsch
// and Carlson, "Monotone piecewise cubic interpolation", 1980). Rotations: cumulative cubic Bezier
// curves of unit quaternions (Kim, Kim and Shin, SIGGRAPH 1995), with the same rule for angular
// velocities. Input: n keys; output: a value at a fractional frame. Cost: O(log n) per value.
#include "compose/camera/animation_curves.h"

#include <algorithm>
#include <cmath>
#include <iterator>
#include <type_traits>

namespace raystage::compose {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

// Above 1, so that unevenly spaced keys of a uniform motion keep it uniform; at 1.5, curves of
// positions and quaternions stay close to the chord. Monotone numbers would allow 3.
constexpr double kSlopeLimit = 1.5;

double length(double v) { return std::abs(v); }
double length(const Vector3d& v) { return v.norm(); }

template <class V>
V limited(const V& slope, double limit) {
  const double size = length(slope);
  return size > limit ? V(slope * (limit / size)) : slope;
}

/// Returns the slope at a key between mean slopes `before` over `h0` frames, `after` over `h1`.
template <class V>
V inner_slope(const V& before, double h0, const V& after, double h1) {
  if constexpr (std::is_same_v<V, double>) {
    // At an extremum any slope would overshoot, for a focal length even below zero.
    if (before * after <= 0) return 0;
  }
  const V parabola = (before * h1 + after * h0) / (h0 + h1);
  return limited(parabola, kSlopeLimit * std::min(length(before), length(after)));
}

/// Returns the slope at an end that has no acceleration there.
template <class V>
V end_slope(const V& mean, const V& inner) {
  return limited(V((mean * 3.0 - inner) * 0.5), kSlopeLimit * length(mean));
}

/// Returns the slopes at all keys from the lengths `h` (frames) and mean slopes of the intervals.
template <class V>
std::vector<V> smooth_slopes(const std::vector<V>& means, const std::vector<double>& h) {
  const std::size_t segments = means.size();
  if (segments == 1) return {means[0], means[0]};
  std::vector<V> slopes(segments + 1);
  for (std::size_t i = 1; i < segments; ++i) {
    slopes[i] = inner_slope(means[i - 1], h[i - 1], means[i], h[i]);
  }
  slopes.front() = end_slope(means.front(), slopes[1]);
  slopes.back() = end_slope(means.back(), slopes[segments - 1]);
  return slopes;
}

/// Returns the smooth slopes, slowed down as the keys say.
template <class V, class Key>
std::vector<KeySlopes<V>> slopes_of(const std::vector<V>& means, const std::vector<double>& h,
                                    const std::vector<Key>& keys) {
  std::vector<KeySlopes<V>> slopes;
  const std::vector<V> smooth = smooth_slopes(means, h);
  for (std::size_t i = 0; i < keys.size(); ++i) {
    const KeySpeed& speed = keys[i].speed;
    slopes.push_back({V(smooth[i] * speed.arriving), V(smooth[i] * speed.leaving)});
  }
  return slopes;
}

template <class V>
V hermite(const V& p0, const V& v0, const V& p1, const V& v1, double h, double u) {
  const double u2 = u * u, u3 = u2 * u;
  const double rise = 3 * u2 - 2 * u3;
  return p0 + (p1 - p0) * rise + v0 * (h * (u3 - 2 * u2 + u)) + v1 * (h * (u3 - u2));
}

/// Returns the rotation vector of the smaller angle: q and -q give the same.
Vector3d rotation_vector(Quaterniond q) {
  if (q.w() < 0) q.coeffs() = -q.coeffs();
  const double sine = q.vec().norm();
  if (sine < 1e-12) return 2 * q.vec();
  return q.vec() * (2 * std::atan2(sine, q.w()) / sine);
}

Quaterniond from_rotation_vector(const Vector3d& v) {
  const double angle = v.norm();
  // Series of sin(angle / 2) / angle near 0.
  const double scale = angle < 1e-6 ? 0.5 - angle * angle / 48 : std::sin(angle / 2) / angle;
  Quaterniond q;
  q.w() = std::cos(angle / 2);
  q.vec() = scale * v;
  return q;
}

}  // namespace

KeyInterval find_key_interval(const std::vector<double>& frames, double frame) {
  const auto after = std::upper_bound(frames.begin(), frames.end(), frame);
  if (after == frames.begin()) return {0, 0, 0};
  const auto from = static_cast<std::size_t>(std::distance(frames.begin(), after)) - 1;
  if (after == frames.end()) return {from, from, 0};
  return {from, from + 1, (frame - frames[from]) / (*after - frames[from])};
}

template <class V>
Curve<V>::Curve(const std::vector<CurveKey<V>>& keys) {
  std::vector<V> means;
  std::vector<double> h;
  for (const CurveKey<V>& key : keys) {
    if (!frames_.empty()) {
      h.push_back(key.frame - frames_.back());
      means.push_back((key.value - values_.back()) / h.back());
    }
    frames_.push_back(key.frame);
    values_.push_back(key.value);
  }
  if (!means.empty()) slopes_ = slopes_of(means, h, keys);
}

template <class V>
V Curve<V>::operator()(double frame) const {
  const auto [from, to, u] = find_key_interval(frames_, frame);
  if (u == 0) return values_[from];
  return hermite(values_[from], slopes_[from].leaving, values_[to], slopes_[to].arriving,
                 frames_[to] - frames_[from], u);
}

template class Curve<double>;
template class Curve<Vector3d>;

RotationCurve::RotationCurve(const std::vector<CurveKey<Quaterniond>>& keys) {
  std::vector<Vector3d> means;
  std::vector<double> h;
  for (const CurveKey<Quaterniond>& key : keys) {
    if (!frames_.empty()) {
      h.push_back(key.frame - frames_.back());
      // The rotation axis between two keys has the same coordinates in the frames of both keys.
      means.push_back(rotation_vector(values_.back().conjugate() * key.value) / h.back());
    }
    frames_.push_back(key.frame);
    values_.push_back(key.value);
  }
  if (!means.empty()) angular_velocities_ = slopes_of(means, h, keys);
}

Quaterniond RotationCurve::operator()(double frame) const {
  const auto [from, to, u] = find_key_interval(frames_, frame);
  if (u == 0) return values_[from];
  const double h = frames_[to] - frames_[from];
  // The first and the last factor determine the angular velocities at the ends.
  const Vector3d first_third = angular_velocities_[from].leaving * (h / 3);
  const Vector3d last_third = angular_velocities_[to].arriving * (h / 3);
  const Quaterniond first = from_rotation_vector(first_third);
  const Quaterniond last = from_rotation_vector(last_third);
  const Vector3d middle = rotation_vector(first.conjugate() * values_[from].conjugate() *
                                          values_[to] * last.conjugate());
  const double v = 1 - u;
  const double b1 = 1 - v * v * v, b2 = u * u * (3 - 2 * u), b3 = u * u * u;
  return (values_[from] * from_rotation_vector(first_third * b1) *
          from_rotation_vector(middle * b2) * from_rotation_vector(last_third * b3))
      .normalized();
}

}  // namespace raystage::compose
