// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <limits>

namespace raystage::rig {

/// A row of wall-eyed cameras as seen from above (thesis 5.1): they look along +z from z = 0.
struct CameraRow {
  double focal_length = 1;  ///< any unit
  double pixel_pitch = 0;   ///< of the cameras, in the unit of the focal length
  double spacing = 0;       ///< between neighbours, metres
  double fov = 0;           ///< full angle, radians
  /// Distance of the plane on which the frusta of skewed cameras coincide, metres (thesis 5.4);
  /// infinite: the cameras are not skewed.
  double fixed_focal_distance = std::numeric_limits<double>::infinity();
};

/// A virtual camera with one row of pixels, the first on the side of -x. A positive rotation turns
/// it to that side (thesis eq. 5.8).
struct RowView {
  double focal_length = 1;  ///< any unit
  double fov = 0;           ///< full angle, radians
  double rotation = 0;      ///< radians
  double depth = 0;         ///< in front of the row, metres; negative behind it
};

/// Returns by how much the rays of pixels n and n + 1 of a view differ on the cameras' image plane,
/// in the unit of their focal length (thesis eq. 5.15 and 5.21). `pitch`: of the view's pixels.
double image_plane_step(const CameraRow& row, const RowView& view, double pitch, int n);

/// Returns the pixel pitch with which the first two pixels of a view are one pixel of the cameras
/// apart (thesis eq. 5.17). The first pixels are on the side of -x. Independent of the view's depth
/// unless the cameras are skewed. Returns 0 where their rays are parallel to the row or point
/// behind it, and infinity where no pitch is large enough, as at the fixed focal distance.
double exact_sampling_pitch(const CameraRow& row, const RowView& view);

/// The pixels of a view whose rays come from distinct samples of a light field (thesis 5.3).
struct EffectiveResolution {
  /// With at most that many, no two adjacent pixels share samples, for rotations up to the view's
  /// to both sides.
  double never_oversampled = 0;
  /// With at least that many, no samples between adjacent pixels are skipped.
  double never_undersampled = 0;
  double unrecorded_share = 0;  ///< of the columns: their rays are in no camera's field of view
};
EffectiveResolution effective_resolution(const CameraRow& row, const RowView& view);

/// Returns the slope ds/du of the line of a view's position in the epipolar-plane image (thesis
/// eq. 5.4 and 5.19); infinite at the fixed focal distance.
double epipolar_slope(const CameraRow& row, double depth);

/// The depths next to the row within which the cameras' pixels limit the resolution (thesis 5.3.3
/// and eq. 5.23), metres. Beyond them the spacing of the cameras does; with a fixed focal plane
/// that is near, their pixels do again far behind that plane.
struct PixelLimitedDepths {
  double behind = 0;    ///< at most 0; minus infinity: no limit
  double in_front = 0;  ///< at least 0; infinity: no limit
};
PixelLimitedDepths pixel_limited_depths(const CameraRow& row);

}  // namespace raystage::rig
