// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <limits>
#include <span>

#include "rig/rig.h"
#include "rig/topology.h"

namespace raystage::planning {

/// A point from which one looks in all directions, world, metres.
struct Viewpoint {
  Eigen::Vector3d position = Eigen::Vector3d::Zero();
  /// Radius of the sphere about the array's centre that is in focus, as render::focal_surface().
  double focal_depth = std::numeric_limits<double>::infinity();
};

/// Returns the share of the directions from a point, 0 to 1, by solid angle, in which no camera
/// recorded the ray: see unrecorded_share(). Of a ring only directions in its plane count, in a row
/// of each of four sides of a cube, whose solid angles differ from angles by up to 0.02 of the
/// share: its cells are strips without a height. Otherwise accurate to 4e-3.
double unrecorded_directions(const Viewpoint& from, const rig::Rig& rig,
                             const rig::Topology& topology);

/// Returns whether at least a share, 0 to 1, of the directions was recorded; faster, and at the
/// borders of distorted pictures less precise.
bool are_directions_recorded(const Viewpoint& from, const rig::Rig& rig,
                             const rig::Topology& topology, double share);

/// Returns the share of the directions from a point, 0 to 1, whose point in focus no camera of the
/// cells sees: see unseen_share(). Tests 4096 directions that are spread evenly.
double unseen_directions(const Viewpoint& from, const rig::Rig& rig, const rig::Topology& topology);

/// Returns whether every ray to a convex body was recorded, as far as the horizon. `corners`: those
/// of its convex hull, world, metres. False for positions in it.
bool is_body_recorded(const Eigen::Vector3d& position, std::span<const Eigen::Vector3d> corners,
                      const rig::Rig& rig, const rig::Topology& topology);

/// Returns the share of unrecorded directions by testing `count` of them: the reference.
double unrecorded_directions_reference(const Viewpoint& from, const rig::Rig& rig,
                                       const rig::Topology& topology, int count);

}  // namespace raystage::planning
