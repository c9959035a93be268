// SPDX-License-Identifier: Apache-2.0
// The surface in focus for single rays, and where rays meet a sphere around them. Output: inverse
// distances (1/m). Cost: constant per ray.
#include "render/common/focal_surface.h"

#include <cmath>
#include <cstddef>
#include <limits>
#include <span>

#include "render/common/plane_projection.h"
#include "render/common/plane_surface.h"

namespace raystage::render {

RaySurface sphere_surface(const Eigen::Vector3d& centre, double radius) {
  return [centre, radius](std::span<const WorldRay> rays, std::span<double> inverse_distance) {
    for (std::size_t i = 0; i < rays.size(); ++i) {
      // In units of the radius: p + t d has length 1 at t = s - p.d; a large radius loses nothing.
      const Eigen::Vector3d from = (rays[i].origin - centre) / radius;
      const double along = from.dot(rays[i].direction);
      const double discriminant = along * along - (from.squaredNorm() - 1);
      const double t = std::sqrt(discriminant) - along;
      inverse_distance[i] = t > 0 ? 1 / t / radius : std::numeric_limits<double>::quiet_NaN();
    }
  };
}

RaySurface focal_surface(const rig::Rig& rig, const Eigen::Vector4d& focal_plane) {
  RaySurface plane = plane_surface(focal_plane);
  if (!rig.looks_around() || focal_plane.head<3>().isZero(0)) return plane;
  const double radius = std::abs(signed_plane_distance(focal_plane, rig.centre()));
  return radius > 0 ? sphere_surface(rig.centre(), radius) : plane;
}

}  // namespace raystage::render
