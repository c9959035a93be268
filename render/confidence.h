// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/common/light_field_frame.h"
#include "render/common/view.h"

namespace raystage {

/// Codes of 8 bits by which a camera's colour differs from the picture's, root mean square over R,
/// G and B on sRGB's scale, where it counts by half as agreeing: above what JPEG and the cameras'
/// differences leave, below what the eye takes for another colour.
inline constexpr double kHalfConfidenceDifference = 8;

/// Fills RenderedView::confidence: the part, by their share of the ray, of the four cameras about
/// it (BlendingField) that see the pixel's colour in the direction of the point at the pixel's
/// depth. A camera counts by 1 / (1 + (d / kHalfConfidenceDifference)^2), d being the difference;
/// by nothing where its frame shows nothing of the point. 1: all agree; near 0: they see different
/// things there, as off the focal plane, or something hides the point from all but few; 0 where A
/// is 0. `image`: colours, alpha and depth of `view` at `instant`. Any method's.
void measure_confidence(const VirtualCamera& view, const LightFieldFrame& instant,
                        RenderedView& image);

/// The slow, obvious way, for any view.
void measure_confidence_reference(const VirtualCamera& view, const LightFieldFrame& instant,
                                  RenderedView& image);

}  // namespace raystage
