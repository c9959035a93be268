// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "render/common/world_ray.h"

namespace raystage::render {

/// Returns where rays meet the plane a x + b y + c z + d = 0; (0, 0, 0, d) lies at infinity. Throws
/// Error (bad input) where all four are 0 or one is not finite.
RaySurface plane_surface(const Eigen::Vector4d& plane);

}  // namespace raystage::render
