// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "render/common/world_ray.h"
#include "render/depth/camera_depths.h"

namespace raystage {

/// Where any ray, of a view or not, meets what the cameras' depths show: it is followed through the
/// depths of the three cameras that it passes nearest to and that see some of it (relief mapping:
/// Policarpo, Oliveira and Comba 2005), as far as the scene reaches; of what they say, the middle
/// counts. A camera that loses sight of the ray behind something nearer has less of a say than one
/// that does not. A ray that meets nothing ends where the scene does; one that does not pass
/// through the scene gives not-a-number.
///
/// `scene`: as DepthEstimationSettings. The surface keeps `depths`.
RaySurface depth_surface(std::shared_ptr<const CameraDepths> depths, const Rig& rig,
                         DepthRange scene);

}  // namespace raystage
