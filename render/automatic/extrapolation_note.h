// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "render/common/light_field_frame.h"
#include "render/common/view.h"

namespace raystage::render {

/// Returns a note if a view is farther from every camera than the cameras are from each other. The
/// note names the distance and the side of the array. The distance has one digit, so that a moving
/// camera does not get a note per frame. Returns nullopt for views among the cameras, which
/// leave-one-out measurements represent.
std::optional<std::string> extrapolation_note(const VirtualCamera& view,
                                              const LightFieldFrame& instant);

}  // namespace raystage::render
