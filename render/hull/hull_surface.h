// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "render/common/world_ray.h"
#include "render/hull/matte.h"
#include "rig/rig.h"

namespace raystage::render {

struct Silhouette {
  int camera = 0;  ///< of the rig
  std::shared_ptr<const Matte> matte;
};

/// Returns the surface of the visual hull: points that are seen by at least `min_views` cameras and
/// are within the silhouette of each of these (Matusik, Buehler, Raskar, Gortler and McMillan,
/// "Image-Based Visual Hulls", SIGGRAPH 2000, section 2). A ray keeps the intervals whose
/// projections are on foreground in each image. They are found by walking along the projected line
/// pixel by pixel, over the intervals that the cameras before have left. The search starts
/// `nearest` metres from the eye. Copies only pointers; `rig` must outlive the surface.
RaySurface hull_surface(const rig::Rig& rig, std::vector<Silhouette> silhouettes, int min_views,
                        double nearest);

/// Tests `steps` evenly spaced inverse distances per ray: the reference of hull_surface().
RaySurface hull_surface_reference(const rig::Rig& rig, std::vector<Silhouette> silhouettes,
                                  int min_views, double nearest, int steps);

}  // namespace raystage::render
