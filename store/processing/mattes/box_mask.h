// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "rig/rig.h"
#include "schemas/matte_settings.h"

namespace raystage::store {

/// Returns for each pixel of a camera whether it is visible. Its ray must intersect one of the
/// boxes to `keep` (if there are any) and none of the `garbage` boxes. Row by row, without padding.
std::vector<bool> compute_box_mask(const rig::Rig::Camera& camera,
                                   std::span<const schemas::MatteSettings::Box> keep,
                                   std::span<const schemas::MatteSettings::Box> garbage);

}  // namespace raystage::store
