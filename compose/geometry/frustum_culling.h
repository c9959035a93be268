// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "compose/geometry/surface_point.h"
#include "render/common/view.h"

namespace raystage::compose {

/// Returns false only if the bounding sphere of the mesh is outside one side of the view frustum or
/// behind the camera. `camera`: without distortion.
bool may_intersect_frustum(const MeshInstance& mesh, const render::VirtualCamera& camera);

}  // namespace raystage::compose
