// SPDX-License-Identifier: Apache-2.0
// Internal to calibrate/geometry: CameraModel's projection as a template, for automatic
// differentiation.
#pragma once

#include <Eigen/Core>
#include <array>
#include <string_view>

#include "schemas/geometry.h"

namespace raystage::calibrate {

/// Lens parameters of the solvers: fx, fy, cx, cy, k1, k2, p1, p2, k3.
constexpr int kLensParameterCount = 9;
using LensParameters = std::array<double, kLensParameterCount>;
constexpr std::array<std::string_view, kLensParameterCount> kLensParameterNames{
    "fx", "fy", "cx", "cy", "k1", "k2", "p1", "p2", "k3"};

inline LensParameters lens_parameters(const schemas::Intrinsics& k) {
  const schemas::Distortion& d = k.distortion;
  return {k.fx, k.fy, k.cx, k.cy, d.k1, d.k2, d.p1, d.p2, d.k3};
}

inline schemas::Intrinsics intrinsics_from_parameters(const LensParameters& v) {
  return {v[0], v[1], v[2], v[3], {v[4], v[5], v[6], v[7], v[8]}};
}

/// Returns the pixel of a point in front of the camera (z < 0). Does not check the valid range of
/// the lens model.
template <class T>
Eigen::Matrix<T, 2, 1> project_to_pixel(const Eigen::Matrix<T, 3, 1>& in_camera, const T* lens,
                                        bool square_pixels) {
  const T x = in_camera.x() / -in_camera.z(), y = in_camera.y() / in_camera.z();
  const T s = x * x + y * y;
  const T factor = T(1) + s * (lens[4] + s * (lens[5] + s * lens[8]));
  const T &p1 = lens[6], &p2 = lens[7];
  const T u = x * factor + T(2) * p1 * x * y + p2 * (s + T(2) * x * x);
  const T v = y * factor + p1 * (s + T(2) * y * y) + T(2) * p2 * x * y;
  return {lens[0] * u + lens[2], lens[square_pixels ? 0 : 1] * v + lens[3]};
}

}  // namespace raystage::calibrate
