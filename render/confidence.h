// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/common/light_field_frame.h"
#include "render/common/view.h"

namespace raystage::render {

/// The colour difference at which a camera agrees by half: 8-bit codes, root mean square over R, G
/// and B on the sRGB scale. It is above the differences left by JPEG and between cameras, and below
/// what the eye takes for another colour.
inline constexpr double kHalfConfidenceDifference = 8;

/// Fills RenderedView::confidence: the weighted mean agreement of the four cameras around each ray
/// (BlendingField) with the pixel's colour, in the direction of the point at the pixel's depth. A
/// camera's agreement is 1 / (1 + (d / kHalfConfidenceDifference)^2) with the colour difference d.
/// It is 0 where the camera's frame shows nothing of the point. 1 means that all cameras agree.
/// Values near 0 mean that they see different objects, as off the focal plane, or that the point is
/// occluded for all but a few. 0 where A is 0. `image`: colours, alpha and depth of `view` at
/// `instant`, by any method.
void measure_confidence(const VirtualCamera& view, const LightFieldFrame& instant,
                        RenderedView& image);

/// Fills RenderedView::confidence per ray in double, for any view: the reference for
/// measure_confidence().
void measure_confidence_reference(const VirtualCamera& view, const LightFieldFrame& instant,
                                  RenderedView& image);

}  // namespace raystage::render
