// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>
#include <vector>

#include "calibrate/geometry/array_model.h"
#include "calibrate/geometry/time_correction.h"

namespace raystage::calibrate {

/// The line times of an array's cameras (rig/row_times.h): given, or found from a moving light.
struct LineTimes {
  enum class Source {
    kNone,          ///< neither given nor estimated
    kGiven,         ///< by a rig, and used unchanged
    kFound,         ///< for this camera
    kFoundCommon,   ///< one value for all cameras with its frame size
    kInsignificant  ///< estimated, but not significant: taken for a global shutter
  };
  struct Camera {
    Source source = Source::kNone;
    double us = 0;            ///< that is used, microseconds; 0: global shutter
    double estimate_us = 0;   ///< that was estimated, used or not
    double deviation_us = 0;  ///< one standard deviation of the estimate
  };
  std::vector<Camera> cameras;  ///< empty: none is given, none was estimated

  bool is_any_found() const;
};

/// An estimate counts as a rolling shutter if it is above so many standard deviations and the
/// read-out of a frame takes longer than this.
inline constexpr double kMinLineTimeDeviations = 5, kMinReadOutMs = 0.5;

/// Returns the line times from `used` (those that the times have already, microseconds) and their
/// correction. Cameras with frames of one size share a common value, which is several times more
/// precise, unless the correction shows that they differ: by chi-squared, and by more than a
/// twentieth. `given`: cameras whose line time is known.
LineTimes choose_line_times(const ArrayModel& model, const std::vector<double>& used,
                            const std::vector<bool>& given, const TimeCorrection& correction);

/// Returns a line for a report: "Shutter    rolling: ..."; empty without line times.
std::string format_line_times(const LineTimes& line_times, const ArrayModel& model);

std::string_view name_of(LineTimes::Source source);

}  // namespace raystage::calibrate
