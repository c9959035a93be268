// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <boost/multiprecision/cpp_bin_float.hpp>
#include <cmath>
#include <optional>

#include "render/common/view.h"
#include "rig/topology.h"

/// The geometry of views in 50 decimal digits, for tests: textbook intersections of the same
/// doubles that the product receives. All differences are the product's rounding.
namespace raystage::testing {

using Real = boost::multiprecision::cpp_bin_float_50;

struct ExactVector {
  Real x, y, z;
};

inline ExactVector exact(const Eigen::Vector3d& v) {
  return {Real(v.x()), Real(v.y()), Real(v.z())};
}
inline ExactVector operator+(const ExactVector& a, const ExactVector& b) {
  return {a.x + b.x, a.y + b.y, a.z + b.z};
}
inline ExactVector operator-(const ExactVector& a, const ExactVector& b) {
  return {a.x - b.x, a.y - b.y, a.z - b.z};
}
inline ExactVector operator*(const Real& s, const ExactVector& v) {
  return {s * v.x, s * v.y, s * v.z};
}
inline Real dot(const ExactVector& a, const ExactVector& b) {
  return a.x * b.x + a.y * b.y + a.z * b.z;
}
inline ExactVector cross(const ExactVector& a, const ExactVector& b) {
  return {a.y * b.z - a.z * b.y, a.z * b.x - a.x * b.z, a.x * b.y - a.y * b.x};
}
inline Real norm(const ExactVector& v) { return sqrt(dot(v, v)); }

/// Returns the world direction of the ray through a pixel position of a view without distortion.
inline ExactVector exact_ray(const render::VirtualCamera& view, double x, double y) {
  const schemas::Intrinsics& k = view.intrinsics;
  const Real right = (Real(x) - k.cx) / k.fx, up = -(Real(y) - k.cy) / k.fy;
  const Eigen::Matrix3d& r = view.pose.world_from_camera_rotation;
  return right * exact(r.col(0)) + (up * exact(r.col(1)) - exact(r.col(2)));
}

/// Returns the weights of a cell's cameras where the line through the eye along `ray` crosses it.
/// They are barycentric coordinates in a triangle, linear ones in a strip along `up`; they sum to 1
/// and are negative outside of the cell. Returns nullopt for a ray parallel to the cell.
inline std::optional<std::array<Real, 3>> exact_weights(
    const std::array<Eigen::Vector3d, 3>& centres, int count, const Eigen::Vector3d& up,
    const Eigen::Vector3d& eye, const ExactVector& ray) {
  if (count == 1) return std::array<Real, 3>{1, 0, 0};
  const ExactVector first = exact(centres[0]), second = exact(centres[1]) - first;
  const ExactVector third = count == 3 ? exact(centres[2]) - first : exact(up);
  const ExactVector normal = cross(second, third);
  const Real along = dot(normal, ray);
  if (along == 0) return std::nullopt;
  const Real t = dot(normal, first - exact(eye)) / along;
  const ExactVector hit = (exact(eye) + t * ray) - first;
  const Real area = dot(normal, normal);
  const Real w1 = dot(cross(hit, third), normal) / area;
  const Real w2 = count == 3 ? dot(cross(second, hit), normal) / area : Real(0);
  return std::array<Real, 3>{1 - w1 - w2, w1, w2};
}

/// Returns the signed distance of a point from a plane that has a normal, metres.
inline Real exact_plane_distance(const Eigen::Vector4d& plane, const Eigen::Vector3d& point) {
  const ExactVector normal = exact(plane.head<3>());
  return (dot(normal, exact(point)) + plane.w()) / norm(normal);
}

/// Returns the planar depth at which a ray (scaled to 1 along the view's axis) meets a plane that
/// has a normal. It is negative behind the eye; nullopt if parallel.
inline std::optional<Real> exact_depth(const Eigen::Vector4d& plane, const Eigen::Vector3d& eye,
                                       const ExactVector& ray) {
  const ExactVector normal = exact(plane.head<3>());
  const Real along = dot(normal, ray);
  if (along == 0) return std::nullopt;
  return -(dot(normal, exact(eye)) + plane.w()) / along;
}

/// Returns the pixel at which a camera sees a world direction (any length), even far outside of its
/// image; nullopt if the direction is behind the camera.
inline std::optional<std::array<Real, 2>> exact_projection(const schemas::Intrinsics& k,
                                                           const rig::Pose& camera,
                                                           const ExactVector& towards) {
  const Eigen::Matrix3d& r = camera.world_from_camera_rotation;
  const Real ahead = -dot(exact(r.col(2)), towards);
  if (ahead <= 0) return std::nullopt;
  const Real x = dot(exact(r.col(0)), towards) / ahead, y = -dot(exact(r.col(1)), towards) / ahead;
  const schemas::Distortion& d = k.distortion;
  const Real rr = x * x + y * y, radial = 1 + rr * (d.k1 + rr * (d.k2 + rr * Real(d.k3)));
  return std::array<Real, 2>{
      k.fx * (x * radial + 2 * x * y * d.p1 + (rr + 2 * x * x) * d.p2) + k.cx,
      k.fy * (y * radial + (rr + 2 * y * y) * d.p1 + 2 * x * y * d.p2) + k.cy};
}

/// Returns the pixel at which a camera sees the point of `plane` on the ray. Returns nullopt if the
/// ray does not meet the plane in front of the eye, or the point is behind the camera.
inline std::optional<std::array<Real, 2>> exact_pixel(const schemas::Intrinsics& k,
                                                      const rig::Pose& camera,
                                                      const Eigen::Vector4d& plane,
                                                      const Eigen::Vector3d& eye,
                                                      const ExactVector& ray) {
  ExactVector towards = ray;
  if (!plane.head<3>().isZero(0)) {
    const auto depth = exact_depth(plane, eye, ray);
    if (!depth || *depth <= 0) return std::nullopt;
    towards = (exact(eye) + *depth * ray) - exact(camera.position);
  }
  return exact_projection(k, camera, towards);
}

/// Returns the magnitude of the terms of a ray that is scaled to 1 along the view's axis. A ray in
/// double is accurate to a few roundings of it.
inline double ray_term_magnitude(const render::VirtualCamera& view, double x, double y) {
  const schemas::Intrinsics& k = view.intrinsics;
  return 1 + (std::abs(x) + std::abs(k.cx)) / k.fx + (std::abs(y) + std::abs(k.cy)) / k.fy;
}

inline double off(double value, const Real& truth) {
  return static_cast<double>(abs(Real(value) - truth));
}

}  // namespace raystage::testing
