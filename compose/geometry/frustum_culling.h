// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "compose/geometry/surface_point.h"
#include "render/common/view.h"

namespace raystage {

/// Whether a camera, which must not distort, may see some of a mesh: false only where a ball around
/// it lies beyond one of the view's sides, or behind the eye.
bool may_intersect_frustum(const MeshInstance& mesh, const VirtualCamera& camera);

}  // namespace raystage
