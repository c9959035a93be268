// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "rig/rig.h"
#include "schemas/matte_settings.h"

namespace raystage {

/// Of each pixel of a camera, whether its ray shows what it sees: where there are boxes to `keep`,
/// it goes through one of them, and it goes through none of the `garbage`. Rows without padding.
std::vector<bool> rays_that_show(const Rig::Camera& camera,
                                 std::span<const MatteSettings::Box> keep,
                                 std::span<const MatteSettings::Box> garbage);

}  // namespace raystage
