// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <span>
#include <vector>

#include "render/common/world_ray.h"
#include "render/hull/matte.h"
#include "rig/rig.h"

namespace raystage {

/// A camera and its silhouette at one instant.
struct Silhouette {
  int camera = 0;  ///< of the rig
  std::shared_ptr<const Matte> matte;
};

/// The visual hull: points that at least `min_views` cameras see, and that lie within the
/// silhouette of each that does (Matusik, Buehler, Raskar, Gortler and McMillan, "Image-Based
/// Visual Hulls", SIGGRAPH 2000, section 2). A ray keeps the intervals of its length that lie, as
/// lines in each camera's image, on foreground; found by walking along the lines, pixel by pixel,
/// over what the cameras before have left. Nothing nearer to the eye than `nearest` metres is
/// looked for. Copies nothing but pointers; `rig` must live on.
RaySurface hull_surface(const Rig& rig, std::vector<Silhouette> silhouettes, int min_views,
                        double nearest);

/// The reference of hull_surface(): tests `steps` points of each ray, evenly spaced in inverse
/// distance.
RaySurface hull_surface_reference(const Rig& rig, std::vector<Silhouette> silhouettes,
                                  int min_views, double nearest, int steps);

}  // namespace raystage
