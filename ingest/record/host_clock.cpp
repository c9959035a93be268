// SPDX-License-Identifier: Apache-2.0
// Counts UTC by the difference of the system's clock and the steady one. The difference changes
// slowly while the clock is disciplined, which is followed, and suddenly when it is set.
#include "ingest/record/host_clock.h"

#include <cstdlib>
#include <utility>

#include "ingest/sources/frame_source.h"

namespace raystage::ingest {
namespace {

constexpr Nanoseconds kMaxCorrection = 60 * kNanosecondsPerSecond;

}  // namespace

HostClock::HostClock(std::function<Reading()> read) : read_(std::move(read)) {
  const Reading now = read_();
  utc_from_steady_ = now.utc - now.steady;
}

HostClock::Reading HostClock::read_host() {
  // A thread that is interrupted between the clocks reads them again.
  constexpr Nanoseconds kMoment = 20'000;
  constexpr int kMostReadings = 10;
  Reading reading;
  for (int i = 0; i < kMostReadings; ++i) {
    const Nanoseconds before = host_steady_now();
    reading.utc = host_utc_now();
    const Nanoseconds after = host_steady_now();
    reading.steady = before + (after - before) / 2;
    if (after - before < kMoment) break;
  }
  return reading;
}

Nanoseconds HostClock::utc_at(Nanoseconds steady) {
  const std::scoped_lock lock(mutex_);
  const Reading now = read_();
  const Nanoseconds difference = now.utc - now.steady, change = difference - utc_from_steady_;
  if (std::abs(change) > kMaxCorrection) ignored_ += change;
  utc_from_steady_ = difference;
  return steady + difference - ignored_;
}

Nanoseconds HostClock::utc_now() { return utc_at(host_steady_now()); }

Nanoseconds HostClock::ignored_steps() const {
  const std::scoped_lock lock(mutex_);
  return ignored_;
}

}  // namespace raystage::ingest
