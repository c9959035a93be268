// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/common/method.h"
#include "render/common/world_ray.h"

namespace raystage {

/// Returns the method `visual_hull`: shows the foreground where rays first meet the hull of the
/// cameras' mattes, and is transparent elsewhere. Colours are blended by lumigraph weights. Not
/// supported: occlusion of the hull by itself. With cameras far apart, parts in front may give the
/// colours.
const Method& visual_hull_method();

/// Returns the surface on which rays meet the hull of the method's options, for ray queries. The
/// rig of `instant` must outlive it. Throws Error (bad input) if no camera has a matte at the
/// instant, or a matte is invalid.
RaySurface visual_hull_surface(const MethodOptions& options, const LightFieldFrame& instant,
                               ResultCache& kept);
/// The same by hull_surface_reference().
RaySurface visual_hull_surface_reference(const MethodOptions& options,
                                         const LightFieldFrame& instant, ResultCache& kept);

}  // namespace raystage
