// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "compose/shot_plan.h"
#include "planning/camera_motion.h"
#include "planning/measured_settings.h"
#include "schemas/geometry.h"

namespace raystage::planning {

/// What the cameras of a take recorded of one frame of a shot. With stereo, that of the worse eye.
struct FrameCheck {
  int frame = 0;
  /// Of the take: that have a frame at that time; the fewest of the exposure.
  int cameras = 0;
  double horizontal_fov = 0;  ///< of the view, radians

  /// Of the rays, see LayerCheck::blends_any_camera; 0 to 1, the mean over the exposure. 1 where
  /// the take has no frame at that time.
  double unrecorded_share = 0;
  /// As that, as if all cameras had frames; computed where some have none and rays are missing.
  double unrecorded_share_of_all = 0;
  /// Distance of the camera from the border of its range of motion, metres; negative outside.
  /// Nullopt where the range is empty or not known.
  std::optional<double> boundary_distance = {};
  /// Effective resolution relative to the shot's, along an axis: see
  /// least_source_pixels_per_pixel(); at most 1. Nullopt where no camera sees the view. This and
  /// what follows are those of the middle of the exposure.
  std::optional<double> resolution = {};
  /// See ghosting_pixels(): at the nearest and the farthest depth of the scene.
  std::optional<double> near_ghosting = {}, far_ghosting = {};
};

/// What a take contributes to a shot.
struct LayerCheck {
  std::size_t layer = 0;
  std::string name;    ///< of the layer, or "layer N"
  std::string volume;  ///< as in the shot: takes around one volume
  std::string method;
  bool uses_focal_plane = true;  ///< whether the method samples rays on one focal plane
  /// Whether any camera that sees a ray's point on the focal plane counts (unseen_share()), and not
  /// only those of the cell that it passes (unrecorded_share()).
  bool blends_any_camera = false;
  /// Whether the shot's camera is equirectangular: shares are then those of all directions, by
  /// solid angle, from between the eyes.
  bool sees_all_directions = false;
  int cameras = 0;
  int eyes = 1;        ///< of the shot's camera
  double spacing = 0;  ///< largest distance of neighbours of the complete array, metres
  std::optional<schemas::DepthRange> depth_range;
  /// Why no range of motion is known; empty if it is: that of the complete array.
  std::string no_range_because;
  /// Whether the range of motion is exact; otherwise it is that of inscribed_wall_eyed_array(), and
  /// the camera may move further.
  bool is_range_exact = true;
  std::vector<FrameCheck> frames;  ///< those in which the layer is visible
  /// The largest factor, at most 1, by which the field of view must become narrower (factor on the
  /// tangent of its half) so that every ray was recorded; nullopt: none is enough.
  std::optional<double> field_of_view_factor = {};

  /// Returns the largest disparity error of the frames in pixels; nullopt without a depth range.
  std::optional<double> worst_ghosting() const;
  double worst_unrecorded_share() const;  ///< 0 without frames
  double worst_resolution() const;        ///< 1 without frames, 0 if it is known of none
};

/// What takes recorded of the frames of a shot (thesis 5).
struct ShotCheck {
  std::string shot;
  int width = 0, height = 0;  ///< pixels, with overscan
  std::vector<int> frames;
  std::vector<LayerCheck> layers;
  CameraMotion motion;                             ///< of the camera, between adjacent frames
  MotionLimits motion_limits;                      ///< that it is compared with
  std::vector<MeasuredSetting> measured_settings;  ///< ShotCheckOptions::measured_settings
  /// Bytes that rendering one frame at a time needs, see compose::required_memory(); of the layers
  /// with takes.
  double memory = 0;
  double seconds = 0;  ///< that the computation took

  /// Returns the largest share of rays of a frame that no take recorded. Of takes around a volume
  /// the best one counts.
  double worst_unrecorded_share() const;
  /// Returns the lowest resolution of a frame; of takes around a volume the best one counts.
  double worst_resolution() const;
  /// Returns whether a take is visible in any of the frames.
  bool has_frames() const;
};

/// How much of a shot is checked.
struct ShotCheckOptions {
  bool finds_field_of_view = true;  ///< LayerCheck::field_of_view_factor
  MotionLimits motion_limits = {};  ///< of a rig that could follow the path
  /// Of a bench of the take; empty: nothing was measured.
  std::vector<MeasuredSetting> measured_settings = {};
};

/// Checks frames of a shot against the arrays that recorded its takes. Decodes no picture. Throws
/// Error (bad input) for a shot without a take, or an equirectangular camera, and Error (failed) if
/// stopped.
ShotCheck check_shot(const compose::ShotPlan& plan, const std::string& name,
                     std::span<const compose::PlannedFrame> frames,
                     const ShotCheckOptions& options = {}, const std::stop_token& stop = {});

}  // namespace raystage::planning
