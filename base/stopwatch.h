// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <utility>

namespace raystage {

/// Measures the wall-clock time since its construction or the last lap.
class Stopwatch {
 public:
  double seconds() const { return std::chrono::duration<double>(Clock::now() - start_).count(); }
  double ms() const { return milliseconds(Clock::now() - start_); }
  /// Returns ms() and starts a new lap.
  double lap_ms() {
    const Clock::time_point now = Clock::now();
    return milliseconds(now - std::exchange(start_, now));
  }

 private:
  using Clock = std::chrono::steady_clock;
  static double milliseconds(Clock::duration time) {
    return std::chrono::duration<double, std::milli>(time).count();
  }

  Clock::time_point start_ = Clock::now();
};

}  // namespace raystage
