// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/common/method.h"

namespace raystage::render {

/// Returns the method "aperture": a synthetic aperture (thesis, Reconstruction: `aperture`;
/// Isaksen, McMillan, Gortler 2000). A ray blends all cameras within an aperture around the point
/// where it crosses the array, weighted by ApertureLens. Each camera is sampled where the ray meets
/// the focal plane. Objects off that plane are blurred, as by a lens as wide as the aperture.
///
/// Rays that miss the array are missing, as with focal_plane. Alpha is the part of the weight of
/// present cameras whose cameras saw the ray; coverage is relative to absent cameras too.
///
/// Samples are averaged on the renderer's scale (BlendSpace), as in all methods, so that equal
/// settings give comparable views. A lens adds light: highlights off the focal plane become discs
/// as bright as in a photograph only with BlendSpace::kLinear.
const Method& aperture_method();

/// Renders as the method, per ray in double with whole frames and CameraModel, also for views with
/// distortion: the reference.
RenderedView render_aperture_reference(const ViewRequest& request);

}  // namespace raystage::render
