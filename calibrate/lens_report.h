// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

#include "calibrate/lenses_from_take.h"

namespace raystage::calibrate {

/// Returns residuals, parameters, coverage, the comparison of lens models, reasons and advice as
/// lines of text.
std::string format_lens(const CameraLens& lens);

/// Returns the same of all cameras as JSON.
std::string lens_report_json(std::span<const CameraLens> lenses);

/// Returns the same as a self-contained HTML page. `file`: of the lenses, for its subtitle.
std::string lens_report_html(std::span<const CameraLens> lenses, const std::string& file);

}  // namespace raystage::calibrate
