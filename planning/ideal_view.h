// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <optional>

#include "render/common/view.h"
#include "rig/camera_model.h"

namespace raystage::planning {

/// Returns the view without lens distortion, as it is rendered.
inline render::VirtualCamera ideal_view(render::VirtualCamera view) {
  view.intrinsics.distortion = {};
  return view;
}

/// Returns the pixel of a homogeneous ideal image point (x right, y down), as of
/// PlaneProjection::ideal_from_pixel, or nullopt where the camera does not see it. Fisheyes may see
/// points with w <= 0.
inline std::optional<Eigen::Vector2d> project_ideal(const rig::CameraModel& model,
                                                    const Eigen::Vector3d& ideal) {
  return model.project({ideal.x(), -ideal.y(), -ideal.z()});
}

}  // namespace raystage::planning
