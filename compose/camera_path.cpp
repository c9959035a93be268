// SPDX-License-Identifier: Apache-2.0
#include "compose/camera_path.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "schemas/error.h"

namespace raystage {
namespace {

using Eigen::Quaterniond;
using Eigen::Vector3d;

// Above 1 so that keys unevenly placed on a steady move keep it steady; at 1.5 a quaternion or
// position curve stays close to the chord. Monotone scalars would allow 3 (Fritsch and Carlson).
constexpr double kSlopeLimit = 1.5;

double length(double v) { return std::abs(v); }
double length(const Vector3d& v) { return v.norm(); }

template <class V>
V limited(const V& slope, double limit) {
  const double size = length(slope);
  return size > limit ? V(slope * (limit / size)) : slope;
}

/// Slope at a key between the means `before` over `h0` and `after` over `h1`.
template <class V>
V inner_slope(const V& before, double h0, const V& after, double h1) {
  const V parabola = (before * h1 + after * h0) / (h0 + h1);
  return limited(parabola, kSlopeLimit * std::min(length(before), length(after)));
}

/// Slope at an end: no acceleration there.
template <class V>
V end_slope(const V& mean, const V& inner) {
  const V straight = (mean * 3.0 - inner) * 0.5;
  return limited(straight, kSlopeLimit * length(mean));
}

template <class V>
V hermite(const V& p0, const V& v0, const V& p1, const V& v1, double h, double u) {
  const double u2 = u * u, u3 = u2 * u;
  const double rise = 3 * u2 - 2 * u3;
  return p0 + (p1 - p0) * rise + v0 * (h * (u3 - 2 * u2 + u)) + v1 * (h * (u3 - u2));
}

/// The shorter way round: q and -q give the same.
Vector3d rotation_vector(Quaterniond q) {
  if (q.w() < 0) q.coeffs() = -q.coeffs();
  const double sine = q.vec().norm();
  if (sine < 1e-12) return 2 * q.vec();
  return q.vec() * (2 * std::atan2(sine, q.w()) / sine);
}

Quaterniond from_rotation_vector(const Vector3d& v) {
  const double angle = v.norm();
  // sin(x) / x without the division at 0.
  const double scale = angle < 1e-6 ? 0.5 - angle * angle / 48 : std::sin(angle / 2) / angle;
  Quaterniond q;
  q.w() = std::cos(angle / 2);
  q.vec() = scale * v;
  return q;
}

[[noreturn]] void refuse(const char* what, const char* what_to_do) {
  throw Error::bad_input(what, "camera path", what_to_do);
}

}  // namespace

CameraPath::CameraPath(std::span<const ShotDocument::CameraKey> keys) {
  if (keys.empty()) refuse("no camera key", "Give the shot at least one camera key");
  for (const auto& key : keys) {
    Key mine;
    mine.frame = key.frame;
    mine.position = Vector3d(key.position[0], key.position[1], key.position[2]);
    mine.orientation =
        Quaterniond(key.orientation[0], key.orientation[1], key.orientation[2], key.orientation[3]);
    const double norm = mine.orientation.norm();
    if (!std::isfinite(mine.frame) || !mine.position.allFinite() || !std::isfinite(norm) ||
        norm < 1e-6) {
      refuse("a camera key is not finite or has a quaternion of length 0", "Correct the key");
    }
    mine.orientation.coeffs() /= norm;
    if (!(key.horizontal_fov_deg > 0 && key.horizontal_fov_deg < 180)) {
      refuse("a field of view is not between 0 and 180 degrees", "Correct the camera key");
    }
    mine.focal = 1 / std::tan(key.horizontal_fov_deg * std::numbers::pi / 360);
    mine.velocity = mine.spin = Vector3d::Zero();
    if (!keys_.empty()) {
      if (!(mine.frame > keys_.back().frame)) {
        refuse("camera keys do not rise in frame number", "Sort the keys and remove doubles");
      }
    }
    keys_.push_back(mine);
  }
  const std::size_t segments = keys_.size() - 1;
  if (segments == 0) return;

  std::vector<Vector3d> velocity(segments), spin(segments);
  std::vector<double> zoom(segments), h(segments);
  for (std::size_t i = 0; i < segments; ++i) {
    const Key &a = keys_[i], &b = keys_[i + 1];
    h[i] = b.frame - a.frame;
    velocity[i] = (b.position - a.position) / h[i];
    // The axis of the rotation from a to b reads the same in both keys' own frames.
    spin[i] = rotation_vector(a.orientation.conjugate() * b.orientation) / h[i];
    zoom[i] = (b.focal - a.focal) / h[i];
  }
  for (std::size_t i = 1; i < segments; ++i) {
    Key& key = keys_[i];
    key.velocity = inner_slope(velocity[i - 1], h[i - 1], velocity[i], h[i]);
    key.spin = inner_slope(spin[i - 1], h[i - 1], spin[i], h[i]);
    // At a turning point of the zoom any slope would overshoot, at worst below zero.
    const bool turns = zoom[i - 1] * zoom[i] <= 0;
    key.zoom = turns ? 0 : inner_slope(zoom[i - 1], h[i - 1], zoom[i], h[i]);
  }
  Key &first = keys_.front(), &last = keys_.back();
  if (segments == 1) {
    first.velocity = last.velocity = velocity[0];
    first.spin = last.spin = spin[0];
    first.zoom = last.zoom = zoom[0];
    return;
  }
  const Key &second = keys_[1], &before_last = keys_[segments - 1];
  first.velocity = end_slope(velocity.front(), second.velocity);
  first.spin = end_slope(spin.front(), second.spin);
  first.zoom = end_slope(zoom.front(), second.zoom);
  last.velocity = end_slope(velocity.back(), before_last.velocity);
  last.spin = end_slope(spin.back(), before_last.spin);
  last.zoom = end_slope(zoom.back(), before_last.zoom);
}

CameraPath::Place CameraPath::locate(double frame) const {
  const auto after = std::upper_bound(keys_.begin(), keys_.end(), frame,
                                      [](double f, const Key& key) { return f < key.frame; });
  if (after == keys_.begin()) return {&keys_.front(), &keys_.front(), 0};
  const Key& from = *std::prev(after);
  if (after == keys_.end()) return {&from, &from, 0};
  return {&from, &*after, (frame - from.frame) / (after->frame - from.frame)};
}

Pose CameraPath::pose(double frame) const {
  const auto [from, to, u] = locate(frame);
  Pose pose;
  if (u == 0) {
    pose.position = from->position;
    pose.world_from_camera_rotation = from->orientation.toRotationMatrix();
    return pose;
  }
  const double h = to->frame - from->frame;
  pose.position = hermite(from->position, from->velocity, to->position, to->velocity, h, u);

  // Cumulative cubic Bezier: its first and last factors set the spin at the ends.
  const Quaterniond first = from_rotation_vector(from->spin * (h / 3));
  const Quaterniond last = from_rotation_vector(to->spin * (h / 3));
  const Vector3d middle = rotation_vector(first.conjugate() * from->orientation.conjugate() *
                                          to->orientation * last.conjugate());
  const double v = 1 - u;
  const double b1 = 1 - v * v * v, b2 = u * u * (3 - 2 * u), b3 = u * u * u;
  const Quaterniond orientation =
      from->orientation * from_rotation_vector(from->spin * (h / 3 * b1)) *
      from_rotation_vector(middle * b2) * from_rotation_vector(to->spin * (h / 3 * b3));
  pose.world_from_camera_rotation = orientation.normalized().toRotationMatrix();
  return pose;
}

double CameraPath::horizontal_fov(double frame) const {
  const auto [from, to, u] = locate(frame);
  const double focal =
      u == 0 ? from->focal
             : hermite(from->focal, from->zoom, to->focal, to->zoom, to->frame - from->frame, u);
  return 2 * std::atan(1 / focal);
}

VirtualCamera CameraPath::camera(double frame, int width, int height) const {
  return virtual_camera_with_fov(width, height, horizontal_fov(frame), pose(frame));
}

}  // namespace raystage
