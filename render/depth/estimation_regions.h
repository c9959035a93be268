// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "render/common/light_field_frame.h"
#include "render/common/view.h"
#include "schemas/geometry.h"

namespace raystage::render {

/// A part of a camera's undistorted image, pixels: [left, right) x [top, bottom).
struct PixelRectangle {
  int left = 0, top = 0, right = 0, bottom = 0;

  bool is_empty() const { return right <= left || bottom <= top; }
  bool operator==(const PixelRectangle&) const = default;
};

/// The parts of all cameras of a rig whose depths are estimated, by camera; an empty rectangle:
/// none. No rectangles at all: all of all cameras.
using EstimationRegions = std::vector<PixelRectangle>;

/// Returns whether depths of a camera are estimated.
bool has_region(const EstimationRegions& regions, int camera);

/// Returns the parts that LightFieldFrame::shown_views read: of the `cameras` with the largest
/// weights of each ray, except those of little weight, those pixels that may show a point of the
/// scene that is in view, and a margin. All of all cameras if there are no such views, if they show
/// nothing, or if that saves little. Cost: milliseconds per view.
EstimationRegions needed_regions(const LightFieldFrame& instant, const schemas::DepthRange& scene,
                                 int cameras);

/// Returns the camera that takes a part of another one's picture.
VirtualCamera cropped(const VirtualCamera& camera, const PixelRectangle& part);

}  // namespace raystage::render
