// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <string_view>

#include "calibrate/geometry/calibration.h"

namespace raystage::calibrate {

/// Returns the report as text for a terminal.
std::string format_calibration_report(const Calibration& calibration);

/// Returns the report as JSON: positions in metres, rotations in degrees, other units in the names.
std::string calibration_report_json(const Calibration& calibration);

/// Returns the report as an HTML page: reprojection errors per camera and over its picture, shared
/// observations of camera pairs, uncertainties of poses and lenses. `lens_models`: a section about
/// the models that were compared (lens_models_html()); empty: none were.
std::string calibration_report_html(const Calibration& calibration, std::string_view name,
                                    std::string_view lens_models = "");

}  // namespace raystage::calibrate
