// SPDX-License-Identifier: Apache-2.0
// Projection and unprojection of a pinhole camera with Brown-Conrady distortion (thesis 4.3,
// OpenCV's coefficients k1, k2, p1, p2, k3). The constructor finds the radius at which the
// distortion folds back from the roots of the eigenvalue polynomials of its Jacobian. Undistortion
// uses Newton's method: first on the radius, within a bracket, then in the plane. Inputs: points in
// the camera (metres) or pixels; outputs: pixels or rays. Cost: a few iterations per point.
#include "rig/camera_model.h"

#include <Eigen/LU>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <string>
#include <vector>

#include "base/error.h"

namespace raystage::rig {
namespace {

// The largest ideal radius; rays beyond it, within 1e-8 rad of the camera's plane, do not occur.
constexpr double kLargestRadius = 1e8;
// Tolerance of the inverse, with a margin to the documented 1e-9 px.
constexpr double kInversePixels = 2e-10;

// Polynomial in r up to the sixth power, constant term first.
using Polynomial = std::array<double, 7>;

double evaluate(const Polynomial& p, double r) {
  double value = 0;
  for (std::size_t i = p.size(); i-- > 0;) value = value * r + p[i];
  return value;
}

// Returns the root of `p` between `low` and `high`, where its signs differ, to adjacent doubles.
double bisect(const Polynomial& p, double low, double high) {
  const bool low_positive = evaluate(p, low) > 0;
  for (;;) {
    const double middle = low + (high - low) / 2;
    if (middle <= low || middle >= high) return low;
    ((evaluate(p, middle) > 0) == low_positive ? low : high) = middle;
  }
}

// Returns the increasing radii in (0, kLargestRadius) at which `p` changes sign. The sign changes
// of the derivative bracket them: there is at most one between two.
std::vector<double> sign_changes(const Polynomial& p) {
  Polynomial derivative{};
  bool constant = true;
  for (std::size_t i = 1; i < p.size(); ++i) {
    derivative[i - 1] = static_cast<double>(i) * p[i];
    constant = constant && p[i] == 0;
  }
  if (constant) return {};
  std::vector<double> ends = sign_changes(derivative);
  ends.push_back(kLargestRadius);
  std::vector<double> roots;
  double low = 0;
  for (const double high : ends) {
    if ((evaluate(p, low) > 0) != (evaluate(p, high) > 0)) roots.push_back(bisect(p, low, high));
    low = high;
  }
  return roots;
}

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
    const std::vector<double> roots = sign_changes(eigenvalue);
    if (!roots.empty()) radius = std::min(radius, roots.front());
  }
  return radius;
}

double radial_factor(const schemas::Distortion& d, double s) {
  return 1 + s * (d.k1 + s * (d.k2 + s * d.k3));
}

Eigen::Vector2d distort(const schemas::Distortion& d, const Eigen::Vector2d& x) {
  const double s = x.squaredNorm();
  const double factor = radial_factor(d, s);
  return {x.x() * factor + 2 * d.p1 * x.x() * x.y() + d.p2 * (s + 2 * x.x() * x.x()),
          x.y() * factor + d.p1 * (s + 2 * x.y() * x.y()) + 2 * d.p2 * x.x() * x.y()};
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
std::optional<Eigen::Vector2d> undistort(const schemas::Distortion& d,
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

CameraModel::CameraModel(const schemas::CameraGeometry& geometry)
    : intrinsics_(geometry.intrinsics), width_(geometry.width), height_(geometry.height) {
  const schemas::Distortion& d = intrinsics_.distortion;
  const std::array<double, 9> numbers{
      intrinsics_.fx, intrinsics_.fy, intrinsics_.cx, intrinsics_.cy, d.k1, d.k2, d.p1, d.p2, d.k3};
  const std::string where = "camera " + geometry.id;
  if (!std::ranges::all_of(numbers, [](double number) { return std::isfinite(number); }) ||
      !std::ranges::all_of(geometry.world_from_camera,
                           [](double number) { return std::isfinite(number); })) {
    throw Error::bad_input("the calibration contains a number that is not finite", where,
                           "Give finite intrinsics, distortion and pose");
  }
  if (!(intrinsics_.fx > 0 && intrinsics_.fy > 0)) {
    throw Error::bad_input("the focal length is not positive", where,
                           "Give fx and fy in pixels, above 0");
  }
  if (width_ <= 0 || height_ <= 0) {
    throw Error::bad_input("the image size is not positive", where,
                           "Give width and height in pixels, above 0");
  }
  const double radius = fold_radius(d);
  // A fold within half a pixel of the principal point leaves no usable picture.
  if (!(radius * std::max(intrinsics_.fx, intrinsics_.fy) > 0.5)) {
    throw Error::bad_input("the lens distortion folds back at the principal point", where,
                           "Check the distortion coefficients and their order k1, k2, p1, p2, k3");
  }
  fold_radius_squared_ = radius * radius;
}

std::optional<Eigen::Vector2d> CameraModel::project(const Eigen::Vector3d& x_in_camera) const {
  if (!(x_in_camera.z() < 0)) return std::nullopt;
  return pixel_from_ideal(
      {x_in_camera.x() / -x_in_camera.z(), -x_in_camera.y() / -x_in_camera.z()});
}

std::optional<Eigen::Vector3d> CameraModel::unproject(const Eigen::Vector2d& pixel) const {
  const auto ideal = ideal_from_pixel(pixel);
  if (!ideal) return std::nullopt;
  return Eigen::Vector3d(ideal->x(), -ideal->y(), -1);
}

std::optional<Eigen::Vector2d> CameraModel::pixel_from_ideal(const Eigen::Vector2d& ideal) const {
  // The margin lets results of ideal_from_pixel() at the fold project again.
  if (!ideal.allFinite() || !(ideal.squaredNorm() <= fold_radius_squared_ * (1 + 1e-14))) {
    return std::nullopt;
  }
  const Eigen::Vector2d distorted =
      has_distortion() ? distort(intrinsics_.distortion, ideal) : ideal;
  return Eigen::Vector2d(intrinsics_.fx * distorted.x() + intrinsics_.cx,
                         intrinsics_.fy * distorted.y() + intrinsics_.cy);
}

std::optional<Eigen::Vector2d> CameraModel::ideal_from_pixel(const Eigen::Vector2d& pixel) const {
  if (!pixel.allFinite()) return std::nullopt;
  const Eigen::Vector2d distorted((pixel.x() - intrinsics_.cx) / intrinsics_.fx,
                                  (pixel.y() - intrinsics_.cy) / intrinsics_.fy);
  if (!has_distortion()) return distorted;
  const schemas::Distortion& d = intrinsics_.distortion;
  const double limit = std::sqrt(fold_radius_squared_);
  const double radius = distorted.norm();
  if (radius == 0) return distorted;
  const auto undistorted = undistort_radius(d, radius, limit);
  if (d.p1 == 0 && d.p2 == 0) {
    if (!undistorted) return std::nullopt;
    return distorted * (*undistorted / radius);
  }
  const double largest = std::max(intrinsics_.fx, intrinsics_.fy);
  const double tolerance = kInversePixels / largest;
  const double start = undistorted.value_or(std::min(limit, kLargestRadius));
  // The first start nearly always converges; the others are for pixels near the fold.
  for (const double part : {1.0, 0.9, 0.5, 0.0}) {
    const Eigen::Vector2d first = distorted * (part * start / radius);
    if (const auto ideal = undistort(d, distorted, limit, first, tolerance)) return ideal;
  }
  return std::nullopt;
}

bool CameraModel::contains(const Eigen::Vector2d& pixel) const {
  return pixel.x() >= 0 && pixel.x() <= width_ && pixel.y() >= 0 && pixel.y() <= height_;
}

}  // namespace raystage::rig
