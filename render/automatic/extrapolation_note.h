// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "render/common/light_field_frame.h"
#include "render/common/view.h"

namespace raystage {

/// For people: that a view stands farther from every camera than the cameras from each other, how
/// far (to one digit, so that a camera's way is not a line for every frame) and on which side of
/// the array. None for views among the cameras, of which those left out tell.
std::optional<std::string> extrapolation_note(const VirtualCamera& view,
                                              const LightFieldFrame& instant);

}  // namespace raystage
