// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <fmt/format.h>

#include <string>

#include "store/shutter_summary.h"

namespace raystage::cli {

/// Returns what is assumed about the shutters of a take, for example "rolling: line time 46.9 us,
/// read-out 15 ms a frame (rig.json)".
inline std::string shutter_text(const store::ShutterSummary& shutters) {
  if (shutters.is_global()) return "global (rig.json states no line time)";
  const auto range = [](double least, double most) {
    return least == most ? fmt::format("{:.4g}", least)
                         : fmt::format("{:.4g} to {:.4g}", least, most);
  };
  const std::string which =
      shutters.rolling == shutters.cameras
          ? std::string("rolling")
          : fmt::format("rolling in {} of {} cameras", shutters.rolling, shutters.cameras);
  return fmt::format("{}: line time {} us, read-out {} ms a frame (rig.json)", which,
                     range(shutters.min_line_time_us, shutters.max_line_time_us),
                     range(shutters.min_read_out_ms, shutters.max_read_out_ms));
}

}  // namespace raystage::cli
