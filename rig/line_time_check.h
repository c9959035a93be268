// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>

#include "base/error.h"
#include "rig/rig.h"

namespace raystage::rig {

/// Returns the error (bad input) of a line time with which the rows of a frame would take longer
/// than the time until the next frame, which no sensor does, or nullopt. Usual cause: nanoseconds
/// stated as microseconds. `periods_ns`: from frame to frame of each camera; where that is 0 or not
/// given, the period of `fps` counts, in Hz; 0: unknown, not checked. `where`: the rig, for the
/// error, which names the first such camera.
std::optional<Error> line_time_error(const Rig& rig, std::span<const double> periods_ns, double fps,
                                     const std::string& where);

}  // namespace raystage::rig
