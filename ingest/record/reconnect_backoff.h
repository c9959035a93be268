// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <chrono>

namespace raystage::ingest {

/// Computes the pause before the next attempt to open a lost camera: none at first, then doubled
/// after each attempt. A device that fails as soon as it is opened therefore costs little time.
class ReconnectBackoff {
 public:
  using Duration = std::chrono::milliseconds;
  struct Limits {
    Duration initial{250}, maximum{5000};
    Duration reset_after{10000};  ///< an uptime of this length resets the pause to 0
  };
  explicit ReconnectBackoff(const Limits& limits) : limits_(limits) {}

  /// Returns the pause before the next attempt and doubles it for the one after.
  Duration next() {
    const Duration pause = next_;
    next_ = std::clamp(2 * next_, limits_.initial, limits_.maximum);
    return pause;
  }
  /// Reports for how long the camera delivered frames since it was opened.
  void report_uptime(std::chrono::steady_clock::duration time) {
    if (time >= limits_.reset_after) next_ = Duration(0);
  }

 private:
  const Limits limits_;
  Duration next_{0};
};

}  // namespace raystage::ingest
