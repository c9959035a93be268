// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/common/method.h"

namespace raystage {

/// Synthetic aperture (thesis, ReconstructionSettings: `aperture`; Isaksen, McMillan, Gortler
/// 2000): all cameras within an aperture around the place where a ray crosses the array gather it,
/// weighted as ApertureLens says, each sampled where the ray meets the focal plane. What lies off
/// that plane is blurred, as by a lens as wide as the aperture.
///
/// Rays that pass the array by are missing, as with focal_plane. Alpha is the part of the gathered
/// light that cameras with a frame have seen; coverage counts cameras that belong there and have
/// none as well.
///
/// Samples are averaged on the renderer's scale (BlendSpace), as in all methods, so that the same
/// setting gives comparable pictures. A lens adds light: highlights off the focal plane become
/// discs as bright as a photograph's only with BlendSpace::kLinear.
RenderedView render_aperture(const ViewRequest& request);

/// The same, ray by ray in double with whole frames and CameraModel: slow and obvious, and good for
/// views with distortion too.
RenderedView render_aperture_reference(const ViewRequest& request);

const Method& aperture_method();

}  // namespace raystage
