// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "render/common/view.h"
#include "rig/rig.h"
#include "rig/topology.h"

namespace raystage::planning {

/// Returns the share, 0 to 1, of a view's rays that no camera recorded: those that miss the array,
/// and those of which no camera of their cell sees the point on `plane` (thesis 4.1.2).
/// `focal_plane` leaves these pixels at alpha 0. `view`: a perspective camera, rendered without its
/// distortion. `plane`: a x + b y + c z + d = 0 in the world; (0, 0, 0, d) is at infinity. Reads no
/// frames. Throws Error (bad input) for a plane that is none.
double unrecorded_share(const render::VirtualCamera& view, const rig::Rig& rig,
                        const rig::Topology& topology, const Eigen::Vector4d& plane);

/// Returns whether at least a share, 0 to 1, of a view's rays was recorded; faster, and at the
/// borders of distorted pictures less precise than unrecorded_share(). Throws likewise.
bool is_recorded(const render::VirtualCamera& view, const rig::Rig& rig,
                 const rig::Topology& topology, const Eigen::Vector4d& plane, double share);

/// Returns the share, 0 to 1, of a view's rays whose point on `plane` no camera of the cells sees,
/// whichever cell they pass: what methods lack that blend whatever cameras see a point. Tests the
/// rays of a grid of 65 x 49 to the picture's borders: less than a step of it may be overlooked.
double unseen_share(const render::VirtualCamera& view, const rig::Rig& rig,
                    const rig::Topology& topology, const Eigen::Vector4d& plane);

/// Returns the unrecorded share by testing the ray through each pixel's centre: the reference.
double unrecorded_share_reference(const render::VirtualCamera& view, const rig::Rig& rig,
                                  const rig::Topology& topology, const Eigen::Vector4d& plane);

}  // namespace raystage::planning
