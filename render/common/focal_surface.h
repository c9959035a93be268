// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "render/common/world_ray.h"
#include "rig/rig.h"

namespace raystage::render {

/// Returns where rays are in focus: on the focal plane (plane_surface()), or, if the array looks
/// around, on a sphere about its centre that the plane touches. So rays in all directions, as those
/// of an equirectangular view, are in focus at the same depth.
RaySurface focal_surface(const rig::Rig& rig, const Eigen::Vector4d& focal_plane);

/// Returns where rays that start within a sphere (centre in the world, radius in metres, above 0,
/// may be infinite) meet it. Rays that start outside meet its far side, or nothing.
RaySurface sphere_surface(const Eigen::Vector3d& centre, double radius);

}  // namespace raystage::render
