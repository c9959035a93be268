// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>
#include <span>

#include "rig/topology.h"

namespace raystage::rig {

/// Returns the cells of an array on a sphere, dome or ring whose cameras look outwards
/// (Topology::outwards), or nullopt for any other array. Such cameras look away from the mean of
/// their centres (mean cosine above 0.5), in directions that differ (their mean is shorter than
/// 0.8).
///
/// Centres around a volume: the Delaunay triangulation of their directions from the mean, a closed
/// surface (computed in the plane by stereographic projection from the first centre, with exact
/// predicates). Centres in a plane, within 0.1 of the smallest spacing of stations
/// (camera_stations.h): a closed ring of strips along the plane's normal, if the first centres of
/// the stations are the corners of a convex polygon. `viewing_directions`: unit, world, one per
/// centre.
std::optional<Topology> outward_topology(std::span<const Eigen::Vector3d> centres,
                                         std::span<const Eigen::Vector3d> viewing_directions);

}  // namespace raystage::rig
