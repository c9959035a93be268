// SPDX-License-Identifier: Apache-2.0
// Internal to calibrate/geometry: CameraModel's projection as a template, for automatic
// differentiation.
#pragma once

#include <ceres/jet.h>

#include <Eigen/Core>
#include <algorithm>
#include <cmath>

#include "calibrate/geometry/lens_parameters.h"
#include "rig/radial_projection.h"

namespace raystage::calibrate {

/// Returns the projection of a fisheye, or null for a pinhole.
inline const rig::RadialProjection* fisheye_projection(const schemas::Intrinsics& lens) {
  return lens.projection == schemas::Projection::kPinhole
             ? nullptr
             : &rig::radial_projection(lens.projection);
}

/// Returns the distance of an angle in [0, pi]. Beyond the end of the projection it continues along
/// the tangent, so that a solver may cross the end and return.
inline double continued_distance(const rig::RadialProjection& projection, double angle) {
  const double end = projection.largest_angle();
  if (angle <= end) return projection.distance(angle);
  return projection.distance(end) + projection.slope(end) * (angle - end);
}

template <int N>
ceres::Jet<double, N> continued_distance(const rig::RadialProjection& projection,
                                         const ceres::Jet<double, N>& angle) {
  const double slope = projection.slope(std::min(angle.a, projection.largest_angle()));
  return {continued_distance(projection, angle.a), slope * angle.v};
}

/// Returns whether a point in the camera can have a pixel: of a pinhole it is in front of the
/// camera (z < 0), of a fisheye not at its centre or straight behind.
template <class T>
bool has_projection(const Eigen::Matrix<T, 3, 1>& in_camera, const rig::RadialProjection* fisheye) {
  if (in_camera.z() < T(0)) return true;
  return fisheye != nullptr && (in_camera.x() != T(0) || in_camera.y() != T(0));
}

/// Returns the pixel of a point that has_projection(). Does not check the valid range of the lens
/// model. `fisheye`: of fisheye_projection().
template <class T>
Eigen::Matrix<T, 2, 1> project_to_pixel(const Eigen::Matrix<T, 3, 1>& in_camera, const T* lens,
                                        const rig::RadialProjection* fisheye, bool square_pixels) {
  T u, v;
  if (fisheye == nullptr) {
    const T x = in_camera.x() / -in_camera.z(), y = in_camera.y() / in_camera.z();
    const T s = x * x + y * y;
    const T factor = T(1) + s * (lens[4] + s * (lens[5] + s * lens[8]));
    const T &p1 = lens[6], &p2 = lens[7];
    u = x * factor + T(2) * p1 * x * y + p2 * (s + T(2) * x * x);
    v = y * factor + p1 * (s + T(2) * y * y) + T(2) * p2 * x * y;
  } else {
    const T& x = in_camera.x();
    const T y = -in_camera.y(), ahead = -in_camera.z();
    const T across2 = x * x + y * y;
    // Near the axis all projections are alike to the last digit, and the angle has no derivative.
    constexpr double kNearAxis = 1e-16;  // angle squared
    T scale = T(1) / ahead, s = across2 * scale * scale;
    if (!(ahead > T(0) && across2 < kNearAxis * ahead * ahead)) {
      using std::atan2;
      using std::sqrt;
      const T across = sqrt(across2);
      const T distance = continued_distance(*fisheye, T(atan2(across, ahead)));
      scale = distance / across;
      s = distance * distance;
    }
    const T factor = scale * (T(1) + s * (lens[4] + s * (lens[5] + s * (lens[6] + s * lens[7]))));
    u = x * factor;
    v = y * factor;
  }
  return {lens[0] * u + lens[2], lens[square_pixels ? 0 : 1] * v + lens[3]};
}

}  // namespace raystage::calibrate
