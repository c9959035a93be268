// SPDX-License-Identifier: Apache-2.0
#pragma once

#include "render/depth/inverse_depth_map.h"
#include "rig/camera_model.h"

namespace raystage::render {

/// What the values of a map of a recorded picture are the inverse of, 1/m.
enum class DepthQuantity {
  kPlanar,   ///< depth along the camera's axis
  kDistance  ///< distance from the camera's centre
};

/// Returns the quantity that the take stores for a camera: fisheyes also see what has no depth
/// along their axis.
DepthQuantity stored_quantity(const rig::CameraModel& model);

/// Converts a map in the pixels of a recorded picture, in place. Rays of fisheyes at or behind the
/// camera's plane have no planar depth, only kUnknownDepth; so have pixels without a ray.
void convert_recorded_depths(InverseDepthMap& map, const rig::CameraModel& model,
                             DepthQuantity from, DepthQuantity to);

/// Returns the planar inverse depths of a pinhole at the camera's position, from a map that covers
/// the whole recorded picture, at any resolution. `model`: the camera, or the facet of a fisheye
/// whose axes the pinhole has. The samples of a pixel are interpolated, bilinearly in the inverse
/// depth, if they differ by at most `same_surface` (1/m): across edges of depth and next to unknown
/// depths the nearest sample counts alone, so that no depth is between two surfaces.
InverseDepthMap undistorted_depths(const InverseDepthMap& recorded, DepthQuantity quantity,
                                   const rig::CameraModel& model, const VirtualCamera& pinhole,
                                   float same_surface);

/// The opposite of undistorted_depths(): sets those pixels of `into`, a map of the size of the
/// recorded picture, that the pinhole shows and whose depth is known. Others stay as they are, so
/// that the facets of a fisheye fill one map.
void add_recorded_depths(const InverseDepthMap& undistorted, const VirtualCamera& pinhole,
                         const rig::CameraModel& model, DepthQuantity quantity, float same_surface,
                         InverseDepthMap& into);

}  // namespace raystage::render
