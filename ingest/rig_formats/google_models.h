// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "ingest/rig_formats/rig_format.h"

namespace raystage::ingest {

/// Returns the format of Google's Immersive Light Field Video (DeepView video): models.json, a list
/// of fisheyes with one focal length and up to four factors of OpenCV's fisheye distortion.
///
/// A camera looks along +z with y down. Its orientation is the rotation vector (axis times angle in
/// radians) of camera_from_world, and its position is the centre in the world, metres.
const RigFormat& google_models_format();

}  // namespace raystage::ingest
