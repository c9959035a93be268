// SPDX-License-Identifier: Apache-2.0
#include "store/shutter_summary.h"

#include <algorithm>

#include "rig/row_times.h"

namespace raystage::store {

ShutterSummary summarise_shutters(const rig::Rig& rig) {
  ShutterSummary summary;
  summary.cameras = static_cast<int>(rig.cameras.size());
  for (const rig::Rig::Camera& camera : rig.cameras) {
    if (camera.line_time_us == 0) continue;
    const double read_out = rig::read_out_ms(camera.line_time_us, camera.model.height());
    const bool is_first = summary.rolling++ == 0;
    const auto add = [is_first](double value, double& least, double& most) {
      least = is_first ? value : std::min(least, value);
      most = is_first ? value : std::max(most, value);
    };
    add(camera.line_time_us, summary.min_line_time_us, summary.max_line_time_us);
    add(read_out, summary.min_read_out_ms, summary.max_read_out_ms);
  }
  return summary;
}

}  // namespace raystage::store
