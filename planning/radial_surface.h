// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <functional>
#include <stop_token>
#include <vector>

#include "rig/planning/convex_polyhedron.h"

namespace raystage::planning {

/// A closed surface of triangles, counter-clockwise as seen from outside.
struct ClosedSurface {
  std::vector<Eigen::Vector3d> vertices;
  std::vector<std::array<int, 3>> triangles;

  double volume() const;  ///< cubic units
};

/// Returns the surface of a polyhedron.
ClosedSurface surface_of(const rig::ConvexPolyhedron& polyhedron);

/// The surface of a volume, and how far it may be from the volume's border, metres.
struct RadialSurface {
  ClosedSurface surface;
  double error = 0;
};

/// How a volume is measured.
struct RadialSurfaceOptions {
  double reach = 1;         ///< the volume is cut off at that distance from its centre, metres
  double tolerance = 1e-3;  ///< of the surface, metres
  int max_vertices = 20'000;
  std::stop_token stop = {};
  std::function<void()> on_round = [] {};  ///< called after each division
};

/// Returns the surface of the volume of the points where `is_inside` holds, as seen from `centre`,
/// which must be inside: along each direction it ends where a ray from the centre first leaves it.
/// Directions are divided until the surface is within the tolerance between them, or the vertices
/// are used up. Ends early, with an unfinished surface, if stopped. `is_inside` is called from
/// several threads. The volume is searched for in steps of a hundredth of the reach, so that
/// thinner gaps may be missed.
RadialSurface radial_surface(const std::function<bool(const Eigen::Vector3d&)>& is_inside,
                             const Eigen::Vector3d& centre, const RadialSurfaceOptions& options);

}  // namespace raystage::planning
