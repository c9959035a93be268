// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <string>

#include "render/view/instant.h"
#include "render/view/view.h"

namespace raystage {

/// For people: that a view stands farther from every camera than the cameras from each other, how
/// far (to one digit, so that a camera's way is not a line for every frame) and on which side of
/// the array. None for views among the cameras, of which those left out tell.
std::optional<std::string> off_array_note(const VirtualCamera& view, const Instant& instant);

}  // namespace raystage
