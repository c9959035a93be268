// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "compose/camera/shot_camera.h"
#include "schemas/shot_document.h"

namespace raystage::compose {

/// How far the camera of keys may be from the path that they replace, at any frame of the shot.
struct KeyTolerance {
  double position_m = 0.0005;
  double rotation_deg = 0.02;
  double focal_length_share = 0.0005;  ///< of the focal length
  double shift = 0.0002;               ///< lens shift, film back widths
  double focus_dioptres = 0.002;       ///< of the inverse focus distance, 1/m
  double f_number_share = 0.002;       ///< of the f-number
  double shutter_deg = 0.5;
};

/// Returns keys of the whole camera (position, orientation, lens) that follow the path of a shot's
/// camera within a tolerance: those of a camera file, a target, an orbit or a dolly zoom become
/// keys that can be edited. Method: Douglas and Peucker, "Algorithms for the reduction of the
/// number of points required to represent a digitized line", 1973, with the interpolation of
/// ShotCamera: from the first and the last frame on, the frame that is farthest from the path gets
/// a key in each interval, until all frames are close enough. Cost: O(frames) evaluations per
/// round, about log2(keys) rounds, at most one key per frame. Throws Error as ShotCamera::state().
std::vector<schemas::ShotDocument::CameraKey> find_camera_keys(const ShotCamera& camera,
                                                               const schemas::ShotDocument& shot,
                                                               const KeyTolerance& tolerance = {});

/// Returns the shot's camera with keys instead of its file, targets, orbit and dolly zoom.
schemas::ShotDocument::Camera keyed_camera(const schemas::ShotDocument::Camera& camera,
                                           std::vector<schemas::ShotDocument::CameraKey> keys);

}  // namespace raystage::compose
