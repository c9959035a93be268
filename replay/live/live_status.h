// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <optional>
#include <string>
#include <vector>

namespace raystage::replay {

/// How a recording goes on, as its files show it.
struct LiveStatus {
  struct Camera {
    std::string id;
    double fps = 0;               ///< stored frames per second, over the last seconds
    std::int64_t dropped = 0;     ///< frames that are missing, among the records read so far
    std::optional<double> age_s;  ///< of its latest frame; none: it has none yet
  };
  std::vector<Camera> cameras;
  std::optional<double> age_s;  ///< of the newest instant; none: there is none yet
  /// The recorder keeps frames in memory until the end: nothing can be shown before.
  bool is_held = false;
  bool has_ended = false;  ///< all sessions have ended
};

}  // namespace raystage::replay
