// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>

#include "planning/seen_area.h"
#include "render/common/view.h"
#include "rig/rig.h"
#include "rig/topology.h"

namespace raystage::planning {

/// How precisely the unrecorded part of a view's rays is computed.
struct Precision {
  double bend = 2e-4;  ///< see PlaneView
  double enough = 1;   ///< where it is larger, any larger number will do
};

/// Some rays of a perspective camera.
struct RayBundle {
  render::VirtualCamera view;
  Polygon picture = {};                    ///< those in it, pixels; empty: all of the picture
  Measure measure = {};                    ///< of their share
  std::optional<FocalSphere> sphere = {};  ///< in focus in place of a plane
};

/// Returns the share of the rays, 0 to 1, that no camera recorded, see unrecorded_share(). `plane`:
/// at infinity if a sphere is in focus.
double unrecorded_part(const RayBundle& rays, const rig::Rig& rig, const rig::Topology& topology,
                       const Eigen::Vector4d& plane, const Precision& precision = {});

}  // namespace raystage::planning
