// SPDX-License-Identifier: Apache-2.0
// Approximates the FOV model by c1 a + c2 a^3 + ... + c5 a^9 of the angle a, which is the fisheye
// of focal lengths c1 fx, c1 fy with factors c2 / c1 ... c5 / c1: least squares at Chebyshev nodes,
// where the largest error is close to the smallest possible one. Cost: some hundred evaluations.
#include "ingest/rig_formats/fov_lens.h"

#include <Eigen/QR>
#include <algorithm>
#include <cmath>
#include <limits>
#include <numbers>

#include "rig/fisheye_lens.h"

namespace raystage::ingest {
namespace {

constexpr int kTerms = 5, kNodes = 64, kChecks = 2000;

double fov_distance(double angle, double omega) {
  return std::atan(2 * std::tan(angle) * std::tan(omega / 2)) / omega;
}

/// Returns the largest angle within the picture, up to a right angle, where the model ends.
double largest_fov_angle(double fx, double fy, double cx, double cy, double omega, int width,
                         int height) {
  const double x = std::max(std::abs(cx), std::abs(width - cx)) / fx;
  const double y = std::max(std::abs(cy), std::abs(height - cy)) / fy;
  const double turned = std::hypot(x, y) * omega;
  constexpr double kRightAngle = std::numbers::pi / 2;
  if (turned >= kRightAngle) return kRightAngle;
  return std::atan(std::tan(turned) / (2 * std::tan(omega / 2)));
}

}  // namespace

FovApproximation approximate_fov_lens(double fx, double fy, double cx, double cy, double omega,
                                      int width, int height) {
  FovApproximation result;
  schemas::Intrinsics& lens = result.intrinsics;
  lens.fx = fx;
  lens.fy = fy;
  lens.cx = cx;
  lens.cy = cy;
  omega = std::abs(omega);  // the model is even in omega
  if (omega == 0) return result;
  constexpr double kRightAngle = std::numbers::pi / 2;
  const double end = largest_fov_angle(fx, fy, cx, cy, omega, width, height);
  Eigen::Matrix<double, kNodes, kTerms> powers;
  Eigen::Matrix<double, kNodes, 1> distances;
  for (int i = 0; i < kNodes; ++i) {
    const double part = std::cos(kRightAngle * (i + 0.5) / kNodes);  // positive half of 2n nodes
    for (int term = 0; term < kTerms; ++term) powers(i, term) = std::pow(part, 2 * term + 1);
    distances(i) = fov_distance(part * end, omega);
  }
  const Eigen::Matrix<double, kTerms, 1> fitted = powers.colPivHouseholderQr().solve(distances);

  lens.projection = schemas::Projection::kFisheye;
  const double scale = fitted(0) / end;  // focal lengths of the fisheye, in those of the model
  lens.fx *= scale;
  lens.fy *= scale;
  for (int i = 1; i < kTerms; ++i) {
    lens.radial_distortion.at(i - 1) = fitted(i) / std::pow(end, 2 * i + 1) / scale;
  }
  if (end == kRightAngle) lens.half_angle = end;
  result.max_error_px = std::numeric_limits<double>::infinity();
  if (!(scale > 0) || !std::isfinite(scale)) return result;
  const rig::FisheyeLens fisheye(lens);
  if (!(fisheye.largest_angle() >= end)) return result;
  double error = 0;
  for (int i = 1; i <= kChecks; ++i) {
    const double angle = end * i / kChecks;
    error = std::max(error, std::abs(fisheye.distance(angle) * scale - fov_distance(angle, omega)));
  }
  result.max_error_px = error * std::max(fx, fy);
  return result;
}

}  // namespace raystage::ingest
