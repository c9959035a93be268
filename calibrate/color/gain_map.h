// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>

#include "calibrate/color/flat_field_measurement.h"

namespace raystage {

/// What makes a target that is everywhere as bright as even as it is: per channel, on top of
/// `response`, by least squares with nodes that follow each other smoothly; 1 in the middle, as a
/// lens' is.
/// Throws Error (bad input), naming the camera, where part of its picture shows no light.
GainMap fit_gain_map(std::span<const FlatFieldCell> cells, PictureSize size,
                     const PhotometricResponse& response, const std::string& camera);

}  // namespace raystage
