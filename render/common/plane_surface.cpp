// SPDX-License-Identifier: Apache-2.0
#include "render/common/plane_surface.h"

#include <cmath>
#include <cstddef>
#include <limits>
#include <span>

#include "base/error.h"
#include "render/common/plane_projection.h"

namespace raystage::render {
namespace {

using Eigen::Vector3d;

constexpr double kNothing = std::numeric_limits<double>::quiet_NaN();

}  // namespace

RaySurface plane_surface(const Eigen::Vector4d& plane) {
  if (!plane.allFinite() || plane.isZero(0)) {
    throw Error::bad_input("the focal plane's equation is zero or not finite", "focal plane",
                           "Give a x + b y + c z + d = 0 with finite numbers, not all 0");
  }
  const bool at_infinity = plane.head<3>().isZero(0);
  // The scale is arbitrary. Far from the world's origin the terms of a plain sum nearly cancel.
  const Vector3d normal = plane.head<3>().stableNormalized();
  return [plane, normal, at_infinity](std::span<const WorldRay> rays,
                                      std::span<double> inverse_distance) {
    double height = 0;
    for (std::size_t i = 0; i < rays.size(); ++i) {
      if (at_infinity) {
        inverse_distance[i] = 0;
        continue;
      }
      if (i == 0 || rays[i].origin != rays[i - 1].origin) {
        height = signed_plane_distance(plane, rays[i].origin);
      }
      const double inverse = -normal.dot(rays[i].direction) / height;
      inverse_distance[i] = inverse > 0 && std::isfinite(inverse) ? inverse : kNothing;
    }
  };
}

}  // namespace raystage::render
