// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "calibrate/detect/track_interpolation.h"
#include "calibrate/geometry/calibration.h"

namespace raystage::calibrate {

/// Tracks of a light or of board corners in a take.
struct RecordedTracks {
  PointTracks tracks;
  std::vector<schemas::DetectionsDocument::Camera> cameras;
  Nanoseconds period = 0;  ///< between frames
  /// Known line times of the cameras, as in rig.json, which the times do not have yet; 0: unknown
  /// or global shutter. Empty: all are 0.
  std::vector<double> line_times_us = {};
};

struct TrackCalibrationOptions {
  TrackInterpolationOptions points;
  CalibrationOptions calibration;
  bool estimates_clock_offsets = true;  ///< false: the times are used unchanged
  /// Of cameras whose line time is not known: neither in the tracks nor in `calibration.start`.
  bool estimates_line_times = true;
};

struct TrackCalibration {
  InterpolatedTracks points;  ///< with corrected clocks
  Calibration calibration;    ///< with line times
  /// Estimated clock offset of each camera, ns; positive: ahead of the others; mean 0; 0 if
  /// unknown.
  std::vector<Nanoseconds> clock_offsets;
};

/// Calibrates an array and the clock offsets of its cameras. A camera with clock offset d observes
/// a light of velocity v (pixels per second) at a distance v d behind its projection. After each
/// solve d is estimated from all points of a camera and the times are corrected. This ends when
/// every correction is below the time of a fiftieth of a pixel. The time of a detection is that of
/// the row at which it is; line times that are not known are estimated with the clocks
/// (time_correction.h) until they change by less than a thousandth. Throws Error as calibrate().
TrackCalibration calibrate_from_tracks(const RecordedTracks& light,
                                       const TrackCalibrationOptions& options);

/// Returns a line about the largest clock offset, for example "Clocks     set by up to 4.3 ms".
std::string format_clock_offsets(const TrackCalibration& found,
                                 const std::vector<schemas::DetectionsDocument::Camera>& cameras);

}  // namespace raystage::calibrate
