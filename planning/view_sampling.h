// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>

#include "render/common/view.h"
#include "rig/rig.h"
#include "rig/topology.h"

namespace raystage::planning {

/// Returns how many pixels of the cameras lie between two pixels of a view, along the axis where
/// they are fewest (thesis 5.3): the least over 3x3 positions of the view, for the camera nearest
/// to each ray and points on `plane`. Below 1 the cameras recorded fewer details than the view has
/// pixels. Nullopt where no camera sees any of these points. `view`: perspective.
std::optional<double> least_source_pixels_per_pixel(const render::VirtualCamera& view,
                                                    const rig::Rig& rig,
                                                    const rig::Topology& topology,
                                                    const Eigen::Vector4d& plane);

/// Returns by how many pixels of a view the two images of a point lie apart that neighbouring
/// cameras blend on `plane` (thesis 2.2, eq. 2.1), at the picture's centre. `depth`: of the point
/// in front of the array's centre along the mean viewing direction, metres, may be infinite.
/// `spacing`: of the cameras, metres. Nullopt where the view does not look at the plane.
std::optional<double> ghosting_pixels(const render::VirtualCamera& view, const rig::Rig& rig,
                                      const Eigen::Vector4d& plane, double depth, double spacing);

}  // namespace raystage::planning
