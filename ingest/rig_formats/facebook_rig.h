// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "ingest/rig_formats/rig_format.h"

namespace raystage::ingest {

/// Returns the format of facebook360_dep and Surround360: rig.json, a list of cameras with lenses
/// of type FTHETA, RECTILINEAR, EQUISOLID or ORTHOGRAPHIC, in metres; or a single such camera.
///
/// A camera's axes right, up and forward are those of ours; they may be off by 1e-3 and are made
/// orthonormal. `fov` is half_angle, which RECTILINEAR has not: it is ignored there, with a note.
/// Pixel coordinates agree (centre of the top-left pixel at 0.5, 0.5). The file holds three factors
/// of the distortion, for r^3, r^5 and r^7, and no tangential distortion.
const RigFormat& facebook_rig_format();

}  // namespace raystage::ingest
