// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <chrono>

namespace raystage {

/// How long to wait before a lost camera is opened once more: at first not at all, then longer and
/// longer, so that a device that dies as soon as it is opened keeps nobody busy.
class ReconnectBackoff {
 public:
  using Duration = std::chrono::milliseconds;
  struct Limits {
    Duration first{250}, longest{5000};
    Duration steady{10000};  ///< frames for so long: the next loss is a new story
  };
  explicit ReconnectBackoff(const Limits& limits) : limits_(limits) {}

  /// The pause before the next try; each is twice the one before.
  Duration next() {
    const Duration pause = next_;
    next_ = std::clamp(2 * next_, limits_.first, limits_.longest);
    return pause;
  }
  /// Frames came for so long since the camera was opened.
  void report_uptime(std::chrono::steady_clock::duration time) {
    if (time >= limits_.steady) next_ = Duration(0);
  }

 private:
  const Limits limits_;
  Duration next_{0};
};

}  // namespace raystage
