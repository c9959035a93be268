// SPDX-License-Identifier: Apache-2.0
// Computes at which resolution a view samples a light field once (thesis 5.3 and 5.4). A pixel n of
// a view with the rotation th meets the cameras' image planes at f_r (Vx + n Dx) / (Vz + n Dz), up
// to an offset, with V = R (-f_v T, f_v), D = R (d, 0), T = tan(fov / 2). Skewed cameras scale this
// by 1 - depth / f_fixed.
#include "rig/planning/effective_resolution.h"

#include <algorithm>
#include <cmath>

namespace raystage::rig {
namespace {

/// Returns the factor by which skewed cameras move rays less than others (eq. 5.21).
double skew_factor(const CameraRow& row, double depth) {
  return 1 - depth / row.fixed_focal_distance;
}

}  // namespace

double image_plane_step(const CameraRow& row, const RowView& view, double pitch, int n) {
  const double sine = std::sin(view.rotation), cosine = std::cos(view.rotation);
  const double edge = view.focal_length * std::tan(view.fov / 2);
  const double vx = -edge * cosine - view.focal_length * sine, dx = pitch * cosine;
  const double vz = -edge * sine + view.focal_length * cosine, dz = pitch * sine;
  const double first = vz + n * dz;
  // r[n+1] - r[n] without the difference of nearly equal quotients.
  const double step = (dx * vz - vx * dz) / (first * (first + dz));
  return row.focal_length * skew_factor(row, view.depth) * step;
}

double exact_sampling_pitch(const CameraRow& row, const RowView& view) {
  const double sine = std::sin(view.rotation), cosine = std::cos(view.rotation);
  const double tangent = std::tan(view.fov / 2);
  const double first = cosine - tangent * sine;
  if (!(first > 0)) return 0;
  const double skew = std::abs(skew_factor(row, view.depth));
  if (skew == 0) return std::numeric_limits<double>::infinity();
  const double step = row.pixel_pitch / skew;
  const double divisor = row.focal_length + step * (tangent * sine * sine - sine * cosine);
  if (!(divisor > 0)) return std::numeric_limits<double>::infinity();
  return view.focal_length * step * first * first / divisor;
}

EffectiveResolution effective_resolution(const CameraRow& row, const RowView& view) {
  const double width = 2 * view.focal_length * std::tan(view.fov / 2);
  RowView turned = view;
  turned.rotation = -std::abs(view.rotation);
  EffectiveResolution result;
  result.never_oversampled = width / exact_sampling_pitch(row, turned);
  turned.rotation = std::abs(view.rotation);
  result.never_undersampled = width / exact_sampling_pitch(row, turned);
  // Columns between the cameras' outermost rays, as positions on the view's image plane.
  const double half = std::tan(view.fov / 2);
  const auto column_of = [&](double angle) {
    constexpr double kRightAngle = 1.5707963267948966;
    const double from_axis = angle - view.rotation;
    if (std::abs(from_axis) >= kRightAngle) return from_axis > 0 ? half : -half;
    return std::clamp(std::tan(from_axis), -half, half);
  };
  const double recorded = column_of(row.fov / 2) - column_of(-row.fov / 2);
  result.unrecorded_share = std::clamp(1 - recorded / (2 * half), 0.0, 1.0);
  return result;
}

double epipolar_slope(const CameraRow& row, double depth) {
  return -1 / (row.focal_length * (1 / depth - 1 / row.fixed_focal_distance));
}

PixelLimitedDepths pixel_limited_depths(const CameraRow& row) {
  // |slope| = spacing / pitch at 1 / depth = 1 / f_fixed +- pitch / (f_r spacing).
  const double reach = row.pixel_pitch / (row.focal_length * row.spacing);
  const double fixed = 1 / row.fixed_focal_distance;
  const double infinity = std::numeric_limits<double>::infinity();
  return {fixed - reach < 0 ? 1 / (fixed - reach) : -infinity,
          fixed + reach > 0 ? 1 / (fixed + reach) : infinity};
}

}  // namespace raystage::rig
