// SPDX-License-Identifier: Apache-2.0
// Brown-Conrady distortion (thesis 4.3) and its inverse. The radius at which the distortion folds
// back follows from the roots of the eigenvalue polynomials of its Jacobian. Undistortion uses
// Newton's method: first on the radius, within a bracket, then in the plane. Cost: a few iterations
// per point.
#include "rig/brown_conrady.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <vector>

#include "rig/polynomial.h"

namespace raystage::rig {
namespace {

// The largest ideal radius; rays beyond it, within 1e-8 rad of the camera's plane, do not occur.
constexpr double kLargestRadius = 1e8;

double radial_factor(const schemas::Distortion& d, double s) {
  return 1 + s * (d.k1 + s * (d.k2 + s * d.k3));
}

Eigen::Matrix2d distortion_jacobian(const schemas::Distortion& d, const Eigen::Vector2d& x) {
  const double s = x.squaredNorm();
  const double slope = 2 * (d.k1 + s * (2 * d.k2 + 3 * d.k3 * s));  // d(factor)/ds, twice
  Eigen::Matrix2d jacobian = slope * x * x.transpose();
  jacobian.diagonal().array() += radial_factor(d, s);
  const double mixed = 2 * (d.p1 * x.x() + d.p2 * x.y());
  jacobian(0, 0) += 2 * d.p1 * x.y() + 6 * d.p2 * x.x();
  jacobian(1, 1) += 6 * d.p1 * x.y() + 2 * d.p2 * x.x();
  jacobian(0, 1) += mixed;
  jacobian(1, 0) += mixed;
  return jacobian;
}

// Returns r in [0, limit] with r L(r^2) = `distorted`, by Newton's method within a shrinking
// bracket, or nullopt if the polynomial does not reach that value.
std::optional<double> undistort_radius(const schemas::Distortion& d, double distorted,
                                       double limit) {
  const auto excess = [&](double r) { return r * radial_factor(d, r * r) - distorted; };
  double low = 0;
  double high = limit;
  if (!std::isfinite(high)) {
    for (high = std::max(1.0, distorted); excess(high) < 0; high *= 2) {
      if (high > kLargestRadius) return std::nullopt;
    }
  } else if (excess(high) < 0) {
    return std::nullopt;
  }
  double r = std::min(distorted, high);
  for (int step = 0; step < 200; ++step) {
    const double value = excess(r);
    if (value == 0) return r;
    (value > 0 ? high : low) = r;
    const double s = r * r;
    const double slope = 1 + s * (3 * d.k1 + s * (5 * d.k2 + s * 7 * d.k3));
    double next = r - value / slope;
    if (!(next > low && next < high)) next = low + (high - low) / 2;
    if (next == r || !(next > low && next < high)) return r;
    r = next;
  }
  return r;
}

// Returns the ideal point of a distorted one by Newton's method in the plane from `x`, or nullopt
// if the error stays above `tolerance`. Steps are halved until they stay within the fold radius
// `limit` and reduce the error.
std::optional<Eigen::Vector2d> solve_in_plane(const schemas::Distortion& d,
                                              const Eigen::Vector2d& distorted, double limit,
                                              Eigen::Vector2d x, double tolerance) {
  double error = (distort(d, x) - distorted).norm();
  for (int step = 0; step < 100 && error > 0; ++step) {
    const Eigen::Vector2d move = distortion_jacobian(d, x).inverse() * (distorted - distort(d, x));
    bool nearer = false;
    for (double part = 1; part > 1e-6 && !nearer; part /= 2) {
      const Eigen::Vector2d candidate = x + part * move;
      if (!(candidate.norm() <= limit)) continue;
      const double candidate_error = (distort(d, candidate) - distorted).norm();
      if (candidate_error < error) {
        x = candidate;
        error = candidate_error;
        nearer = true;
      }
    }
    if (!nearer) break;
  }
  if (!(error <= tolerance)) return std::nullopt;
  return x;
}

}  // namespace

// Returns the ideal radius at which the distortion folds back, or infinity. The distortion is the
// gradient of a potential: its Jacobian is symmetric, with the radial eigenvalue q = d(rL)/dr and
// the tangential eigenvalue L. p1 and p2 change both by at most 6 |p| r (exactly that much in the
// worst direction of q). If both are positive on a disc, the map is one-to-one there.
double fold_radius(const schemas::Distortion& d) {
  const double tangential = -6 * std::hypot(d.p1, d.p2);
  const std::array<Polynomial, 2> eigenvalues{
      Polynomial{1, tangential, 3 * d.k1, 0, 5 * d.k2, 0, 7 * d.k3},
      Polynomial{1, tangential, d.k1, 0, d.k2, 0, d.k3}};
  double radius = std::numeric_limits<double>::infinity();
  for (const Polynomial& eigenvalue : eigenvalues) {
    const std::vector<double> roots = sign_changes(eigenvalue, kLargestRadius);
    if (!roots.empty()) radius = std::min(radius, roots.front());
  }
  return radius;
}

Eigen::Vector2d distort(const schemas::Distortion& d, const Eigen::Vector2d& x) {
  const double s = x.squaredNorm();
  const double factor = radial_factor(d, s);
  return {x.x() * factor + 2 * d.p1 * x.x() * x.y() + d.p2 * (s + 2 * x.x() * x.x()),
          x.y() * factor + d.p1 * (s + 2 * x.y() * x.y()) + 2 * d.p2 * x.x() * x.y()};
}

std::optional<Eigen::Vector2d> undistort(const schemas::Distortion& d,
                                         const Eigen::Vector2d& distorted, double limit,
                                         double tolerance) {
  const double radius = distorted.norm();
  if (radius == 0) return distorted;
  const auto undistorted = undistort_radius(d, radius, limit);
  if (d.p1 == 0 && d.p2 == 0) {
    if (!undistorted) return std::nullopt;
    return distorted * (*undistorted / radius);
  }
  const double start = undistorted.value_or(std::min(limit, kLargestRadius));
  // The first start nearly always converges; the others are for pixels near the fold.
  for (const double part : {1.0, 0.9, 0.5, 0.0}) {
    const Eigen::Vector2d first = distorted * (part * start / radius);
    if (const auto ideal = solve_in_plane(d, distorted, limit, first, tolerance)) return ideal;
  }
  return std::nullopt;
}

}  // namespace raystage::rig
