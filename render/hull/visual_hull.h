// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/view/method.h"

namespace raystage {

/// `visual_hull`: the foreground, where rays first meet the hull of the cameras' mattes;
/// transparent where they meet none. Colours by lumigraph weights. Parts of the hull that hide it
/// from a camera are not looked for: between cameras far apart, colours may come from what stands
/// before.
Method visual_hull_method();

}  // namespace raystage
