// SPDX-License-Identifier: Apache-2.0
// Fits a polynomial to a fisheye lens by interpolation at Chebyshev's nodes (Trefethen,
// Approximation Theory and Approximation Practice, 2013), and bounds the derivatives of the
// projection by samples of the angle. Input: a lens; output: numbers for the kernels. Cost: a
// thousand evaluations per camera and view.
#include "render/sampling/fisheye_fit.h"

#include <algorithm>
#include <cmath>
#include <numbers>

#include "render/sampling/source_view.h"

namespace raystage::render {
namespace {

constexpr int kTerms = FisheyeFit::kTerms;

/// Returns the coefficients of Chebyshev polynomials through `value` at their nodes.
template <class Function>
std::array<double, kTerms> chebyshev_coefficients(const Function& value) {
  std::array<double, kTerms> at{}, coefficients{};
  for (int i = 0; i < kTerms; ++i) at[i] = value(std::cos(std::numbers::pi * (i + 0.5) / kTerms));
  for (int k = 0; k < kTerms; ++k) {
    for (int i = 0; i < kTerms; ++i) {
      coefficients[k] += at[i] * std::cos(std::numbers::pi * k * (i + 0.5) / kTerms);
    }
    coefficients[k] *= (k == 0 ? 1.0 : 2.0) / kTerms;
  }
  return coefficients;
}

/// Returns the same polynomial by powers, constant term first.
std::array<double, kTerms> powers_from_chebyshev(const std::array<double, kTerms>& coefficients) {
  std::array<double, kTerms> before{1}, now{0, 1}, sum{};  // T0, T1
  for (int k = 0; k < kTerms; ++k) {
    for (int i = 0; i < kTerms; ++i) sum[i] += coefficients[k] * before[i];
    std::array<double, kTerms> next{};  // T(k+1) = 2 s T(k) - T(k-1)
    for (int i = 0; i < kTerms; ++i) next[i] = (i > 0 ? 2 * now[i - 1] : 0.0) - before[i];
    before = now;
    now = next;
  }
  return sum;
}

/// Bounds the derivatives at an angle in (0, pi). The second derivative along a great circle at
/// the angle `a`, whose share across the radius is s and along it t: with r = distance(a), its part
/// along the radius is r'' t^2 + s^2 (r' cot a - r / sin^2 a), that across it is
/// 2 s t (r' / sin a - r cos a / sin^2 a).
void bound_at(const rig::FisheyeLens& lens, double a, FisheyeFit& fit) {
  constexpr double kStep = 1e-4;
  const double sine = std::sin(a), r = lens.distance(a), slope = lens.slope(a);
  const double second = (lens.slope(a + kStep) - lens.slope(a - kStep)) / (2 * kStep);
  const double along =
      std::max(std::abs(second), std::abs(slope * std::cos(a) / sine - r / (sine * sine)));
  const double across = std::abs(slope / sine - r * std::cos(a) / (sine * sine));
  fit.bend = std::max(fit.bend, static_cast<float>(along + across));
  fit.largest_slope = std::max(
      {fit.largest_slope, static_cast<float>(std::abs(slope)), static_cast<float>(r / sine)});
}

}  // namespace

FisheyeFit fit_fisheye(const rig::FisheyeLens& lens, double farthest) {
  // Visibility falls to 0 just below the largest angle: that must be outside of the frame.
  constexpr double kBeyondFrame = 1.05;
  static_assert(kBeyondFrame * kBeyondFrame * (1 - 1 / double{kFoldFade}) > 1);
  const auto corner = lens.angle(farthest);
  const double largest =
      corner ? std::min(lens.largest_angle(), kBeyondFrame * *corner) : lens.largest_angle();
  const auto powers = powers_from_chebyshev(chebyshev_coefficients([&](double s) {
    const double angle = largest * std::sqrt((s + 1) / 2);
    return angle > 0 ? lens.distance(angle) / angle : lens.slope(0);
  }));
  FisheyeFit fit;
  for (int i = 0; i < kTerms; ++i) fit.distance_per_angle[i] = static_cast<float>(powers[i]);
  fit.per_largest_squared = static_cast<float>(1 / (largest * largest));
  constexpr int kSamples = 64;
  // Straight backwards a lens that sees all has no bound.
  constexpr double kFarthest = 0.97 * std::numbers::pi;
  for (int i = 1; i <= kSamples; ++i) {
    bound_at(lens, std::min(largest, kFarthest) * (i - 0.5) / kSamples, fit);
  }
  constexpr float kBetweenSamples = 1.05F;
  fit.bend *= kBetweenSamples;
  fit.largest_slope *= kBetweenSamples;
  return fit;
}

}  // namespace raystage::render
