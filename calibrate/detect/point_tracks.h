// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/time.h"
#include "calibrate/detect/light_spot.h"
#include "calibrate/geometry/detections.h"
#include "store/take.h"

namespace raystage {

/// Where one camera saw the light, or another target that it can tell from others (a corner of a
/// board), by time.
struct PointTrack {
  struct FrameDetection {
    Nanoseconds time = 0;  ///< of the frame, on the array's time
    LightSpot spot;
  };
  std::vector<FrameDetection> frame_detections;  ///< of every frame, by increasing time
  std::array<int, kLightDetectionStatusCount> frame_counts{};  ///< by LightDetectionStatus
};

/// By camera, then by target: one light, or each of a board's corners. As many in all cameras.
using PointTracks = std::vector<std::vector<PointTrack>>;

/// Times of a take's frames on the array's time, ns since its epoch; kNoTime: not to be trusted.
/// From the take's timeline where it has one, otherwise as resynchronising it finds them.
std::vector<std::vector<Nanoseconds>> synchronised_frame_times(const Take& take);

/// Looks for the light in every frame. `progress` gets the part done, in [0, 1]. A spot with less
/// than a tenth of the light that its camera's spots have in the median is unsteady. Throws Error
/// (failed) when a stop is asked for, (bad input) for a damaged frame's take.
PointTracks track_light(const Take& take, const std::vector<std::vector<Nanoseconds>>& times,
                        const LightDetectionSettings& settings,
                        const std::function<void(double)>& progress, const std::stop_token& stop);

/// "Light      in 620 of 720 frames; 60 dark, 40 ambiguous", and which cameras saw it in few.
std::string format_track_summary(const PointTracks& tracks,
                                 const std::vector<DetectionsDocument::Camera>& cameras);

/// The cameras of a take, as detections name them.
std::vector<DetectionsDocument::Camera> detection_cameras(const Take& take);

/// Median time between frames that follow each other, ns; 0 where no camera has two.
Nanoseconds median_frame_period(const std::vector<std::vector<Nanoseconds>>& times);

struct TrackInterpolationSettings {
  int max_points = 300;    ///< instants, spread over the recording
  double min_step_px = 3;  ///< by which the light moved, in the median camera, since the last
  /// Of all instants only the half is used at which targets move least: for boards, that can be
  /// held still, before cameras whose times are not exact.
  bool prefers_still_instants = false;
  double max_curvature_px =
      4;  ///< between what a line and a curve through the frame_detections around say
};

/// Where every camera saw the light at common times.
struct InterpolatedTracks {
  Detections detections;              ///< numbered tick * targets + target
  int targets = 1;                    ///< how many are seen at once
  Nanoseconds begin = 0, period = 0;  ///< time of tick 0; from tick to tick, ns
};

/// Where every camera sees the light at common times: its path interpolated between the frames
/// before and after, which free-running cameras took at other times (a cubic through two on each
/// side, a parabola where one side has only one; nothing where both have). `period`: between
/// frames, ns; frame_detections further apart are not bridged.
InterpolatedTracks interpolate_tracks(const PointTracks& tracks,
                                      const std::vector<DetectionsDocument::Camera>& cameras,
                                      Nanoseconds period,
                                      const TrackInterpolationSettings& settings);

/// How fast a camera sees the light move at a time, pixels per second; none where
/// interpolate_tracks() would not say where it is.
std::optional<Eigen::Vector2d> track_velocity(const PointTrack& track, Nanoseconds time,
                                              Nanoseconds period);

}  // namespace raystage
