// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

#include "calibrate/color/flat_field_measurement.h"

namespace raystage::calibrate {

/// Returns the gains that, applied after `response`, flatten the picture of an evenly lit target; 1
/// in the centre. Each channel is fitted by least squares with a smoothness term between nodes.
/// Throws Error (bad input), which names the camera, if a part of the picture has no light.
schemas::GainMap fit_gain_map(std::span<const FlatFieldCell> cells, rig::PictureSize size,
                              const schemas::PhotometricResponse& response,
                              const std::string& camera);

}  // namespace raystage::calibrate
