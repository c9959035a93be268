// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "ingest/rig_formats/rig_format.h"

namespace raystage::ingest {

/// Returns the format of COLMAP's text models: cameras.txt, images.txt and, when written, an empty
/// points3D.txt. Every registered image is a camera; cameras are sorted by image name.
///
/// Camera models: SIMPLE_PINHOLE, PINHOLE, SIMPLE_RADIAL, RADIAL, OPENCV, SIMPLE_RADIAL_FISHEYE,
/// RADIAL_FISHEYE and OPENCV_FISHEYE exactly; FULL_OPENCV and THIN_PRISM_FISHEYE if the
/// coefficients that our models lack are 0; FOV by a fisheye that is within 0.01 px all over the
/// picture, with a note of the largest error, and refused where there is none.
///
/// COLMAP's cameras look along +z with y down, and its poses are camera_from_world; ours look along
/// -z with y up, and our poses are world_from_camera. World coordinates are not changed, so points
/// of the model remain valid. Pixel coordinates agree (centre of the top-left pixel at 0.5, 0.5).
const RigFormat& colmap_format();

}  // namespace raystage::ingest
