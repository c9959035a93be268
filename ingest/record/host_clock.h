// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <mutex>

#include "base/time.h"

namespace raystage::ingest {

/// UTC as a recording counts it: the system's clock, which is disciplined while frames arrive, but
/// without its steps of more than a minute. A clock that is set during a take would leave a hole in
/// it, or have no times for the frames that follow. Thread-safe.
class HostClock {
 public:
  struct Reading {
    Nanoseconds utc = 0;     ///< by the system's clock, since 1970
    Nanoseconds steady = 0;  ///< host_steady_now() at the same moment
  };

  /// `read` reads both clocks; must be thread-safe.
  explicit HostClock(std::function<Reading()> read = read_host);
  static Reading read_host();

  /// Returns the UTC of a time of host_steady_now().
  Nanoseconds utc_at(Nanoseconds steady);
  Nanoseconds utc_now();
  /// Returns the sum of the steps that were not followed, in ns; positive: the clock was set ahead.
  Nanoseconds ignored_steps() const;

 private:
  std::function<Reading()> read_;
  mutable std::mutex mutex_;
  Nanoseconds utc_from_steady_;  ///< by the system's clock, when it was last read
  Nanoseconds ignored_ = 0;
};

}  // namespace raystage::ingest
