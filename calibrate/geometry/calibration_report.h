// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "calibrate/geometry/calibration.h"

namespace raystage {

/// What a calibration found, for people at a terminal.
std::string format_calibration_report(const Calibration& calibration);

/// All of it, for programs: places in metres, turns in degrees, everything else as it is named.
std::string calibration_report_json(const Calibration& calibration);

/// All of it on one page: how well each camera fits and where in its picture it does not, who saw
/// what together, how sure each place and lens is.
std::string calibration_report_html(const Calibration& calibration, std::string_view name);

}  // namespace raystage
