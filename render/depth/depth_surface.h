// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>

#include "render/common/world_ray.h"
#include "render/depth/camera_depths.h"

namespace raystage::render {

/// Returns a surface that intersects rays with the cameras' depth maps, by relief mapping
/// (Policarpo, Oliveira and Comba 2005). A ray is followed, within the scene, through the maps of
/// the three cameras nearest to it that see a part of it. The result is the median of their hits.
/// Cameras for which something nearer hides a part of the ray are used only if there are no others.
/// A ray without a hit ends at the far end of the scene; a ray that does not pass through the scene
/// gives NaN.
///
/// `scene`: as DepthEstimationOptions. The surface keeps `depths` alive.
RaySurface depth_surface(std::shared_ptr<const CameraDepths> depths, const rig::Rig& rig,
                         schemas::DepthRange scene);

}  // namespace raystage::render
