// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/common/method.h"
#include "render/common/world_ray.h"

namespace raystage {

/// `visual_hull`: the foreground, where rays first meet the hull of the cameras' mattes;
/// transparent where they meet none. Colours by lumigraph weights. Parts of the hull that hide it
/// from a camera are not looked for: between cameras far apart, colours may come from what stands
/// before.
const Method& visual_hull_method();

/// Where rays meet the hull that the method's options ask for, for who queries rays instead of a
/// view; `instant`'s rig must live on. Throws Error (bad input) where no camera has a matte at the
/// instant, or one that is none.
RaySurface visual_hull_surface(const MethodOptions& options, const LightFieldFrame& instant,
                               ResultCache& kept);
/// hull_surface_reference() of it.
RaySurface visual_hull_surface_reference(const MethodOptions& options,
                                         const LightFieldFrame& instant, ResultCache& kept);

}  // namespace raystage
