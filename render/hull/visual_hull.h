// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/common/method.h"

namespace raystage::render {

/// Returns the method `visual_hull`: shows the foreground where rays first meet the hull of the
/// cameras' mattes, and is transparent elsewhere. Colours are blended by lumigraph weights. Not
/// supported: occlusion of the hull by itself. With cameras far apart, parts in front may give the
/// colours.
const Method& visual_hull_method();

}  // namespace raystage::render
