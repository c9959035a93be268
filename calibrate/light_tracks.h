// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <functional>
#include <optional>
#include <stop_token>
#include <string>
#include <vector>

#include "calibrate/light_spot.h"
#include "rig/calibration/detections.h"
#include "schemas/time.h"
#include "store/take.h"

namespace raystage {

/// Where one camera saw the light, or another thing that it can tell from others (a corner of a
/// board), by time.
struct LightTrack {
  struct Sight {
    Nanoseconds time = 0;  ///< of the frame, on the array's time
    LightSpot spot;
  };
  std::vector<Sight> sights;                     ///< of every frame, by increasing time
  std::array<int, kLightResults> frames_with{};  ///< by LightResult
};

/// By camera, then by thing: one light, or each of a board's corners. As many in all cameras.
using Tracks = std::vector<std::vector<LightTrack>>;

/// Times of a take's frames on the array's time, ns since its epoch; kNoTime: not to be trusted.
/// From the take's timeline where it has one, otherwise as resynchronising it finds them.
std::vector<std::vector<Nanoseconds>> frame_times_of(const Take& take);

/// Looks for the light in every frame. `progress` gets the part done, in [0, 1]. A spot with less
/// than a tenth of the light that its camera's spots have in the median is unsteady. Throws Error
/// (failed) when a stop is asked for, (bad input) for a damaged frame's take.
Tracks track_light(const Take& take, const std::vector<std::vector<Nanoseconds>>& times,
                   const LightSettings& settings, const std::function<void(double)>& progress,
                   const std::stop_token& stop);

/// "Light      in 620 of 720 frames; 60 dark, 40 ambiguous", and which cameras saw it in few.
std::string track_text(const Tracks& tracks,
                       const std::vector<DetectionsDocument::Camera>& cameras);

/// The cameras of a take, as detections name them.
std::vector<DetectionsDocument::Camera> cameras_of(const Take& take);

/// Median time between frames that follow each other, ns; 0 where no camera has two.
Nanoseconds period_of(const std::vector<std::vector<Nanoseconds>>& times);

struct LightPointSettings {
  int most_points = 300;     ///< instants, spread over the recording
  double least_step_px = 3;  ///< by which the light moved, in the median camera, since the last
  /// Of all instants only the half is used at which things move least: for boards, that can be held
  /// still, before cameras whose times are not exact.
  bool prefers_rest = false;
  double most_bend_px = 4;  ///< between what a line and a curve through the sights around say
};

/// Where every camera saw the light at common times.
struct LightPoints {
  Detections detections;              ///< numbered tick * things + thing
  int things = 1;                     ///< how many are seen at once
  Nanoseconds begin = 0, period = 0;  ///< time of tick 0; from tick to tick, ns
};

/// Where every camera sees the light at common times: its path interpolated between the frames
/// before and after, which free-running cameras took at other times (a cubic through two on each
/// side, a parabola where one side has only one; nothing where both have). `period`: between
/// frames, ns; sights further apart are not bridged.
LightPoints light_points(const Tracks& tracks,
                         const std::vector<DetectionsDocument::Camera>& cameras, Nanoseconds period,
                         const LightPointSettings& settings);

/// How fast a camera sees the light move at a time, pixels per second; none where light_points()
/// would not say where it is.
std::optional<Eigen::Vector2d> light_speed_at(const LightTrack& track, Nanoseconds time,
                                              Nanoseconds period);

}  // namespace raystage
