// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "ingest/rig_formats/rig_format.h"

namespace raystage::ingest {

/// Returns the format transforms.json of NeRF's own data sets, instant-ngp and nerfstudio. Every
/// frame is a camera, in the order of the file.
///
/// Properties at the top level apply to all frames; a frame may override them. They are fl_x, fl_y
/// (pixels) or, of pinholes, camera_angle_x, camera_angle_y (radians); cx, cy (default: the image
/// centre); w, h (default: the image's size); camera_model OPENCV, PINHOLE or SIMPLE_PINHOLE with
/// k1, k2, k3, p1, p2, or OPENCV_FISHEYE (or is_fisheye) with k1, k2, k3, k4. transform_matrix is
/// world_from_camera in our axes; a uniform scale is removed from it. World coordinates are not
/// changed.
const RigFormat& nerf_format();

}  // namespace raystage::ingest
