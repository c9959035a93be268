// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <functional>
#include <stop_token>
#include <string>
#include <vector>

#include "base/time.h"
#include "calibrate/detect/light_spot.h"
#include "calibrate/geometry/detections.h"
#include "store/take.h"

namespace raystage::calibrate {

/// The track of one target in one camera: a light, or an identifiable corner of a board.
struct PointTrack {
  struct FrameDetection {
    Nanoseconds time = 0;  ///< of the frame, in the array's common time
    LightSpot spot;
  };
  std::vector<FrameDetection> frame_detections;  ///< of every frame, by increasing time
  std::array<int, kLightDetectionStatusCount> frame_counts{};  ///< by LightDetectionStatus
};

/// Tracks by camera, then by target. All cameras have the same number of targets.
using PointTracks = std::vector<std::vector<PointTrack>>;

/// Returns the times of a take's frames by camera in the array's common time, ns since its epoch;
/// kExcludedTime for outliers. They come from the take's timeline or, without one, from a
/// resynchronisation.
std::vector<std::vector<Nanoseconds>> synchronised_frame_times(const store::Take& take);

/// Returns the track of the light in each camera, from every frame. A spot with less than a tenth
/// of the camera's median light counts as unsteady. Calls `progress` with the completed share, in
/// [0, 1]. Throws Error (failed) if a stop is requested, (bad input) for a damaged frame.
PointTracks track_light(const store::Take& take, const std::vector<std::vector<Nanoseconds>>& times,
                        const LightDetectionOptions& options,
                        const std::function<void(double)>& progress, const std::stop_token& stop);

/// Returns "Light      in 620 of 720 frames; 60 dark, 40 ambiguous", and the cameras with few
/// detections.
std::string format_track_summary(const PointTracks& tracks,
                                 const std::vector<schemas::DetectionsDocument::Camera>& cameras);

/// Returns the cameras of a take for a table of detections.
std::vector<schemas::DetectionsDocument::Camera> detection_cameras(const store::Take& take);

/// Returns the median time between consecutive frames, ns; 0 if no camera has two.
Nanoseconds median_frame_period(const std::vector<std::vector<Nanoseconds>>& times);

}  // namespace raystage::calibrate
