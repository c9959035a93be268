// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <cstdint>
#include <functional>
#include <mutex>

namespace raystage::store {

/// Limits bytes per second over all threads (token bucket): a thread waits before it reads. After a
/// pause at most a quarter of a second's bytes may be read at once. Thread-safe.
class ReadPace {
 public:
  using Clock = std::chrono::steady_clock;
  /// `bytes_per_second`: 0: no limit. `now` and `wait`: the clock, exchanged by tests.
  explicit ReadPace(double bytes_per_second, std::function<Clock::time_point()> now = Clock::now,
                    std::function<void(std::chrono::nanoseconds)> wait = {});

  /// Waits until `bytes` may be read. More than the bucket holds are paid for by those that follow.
  void before(std::uint64_t bytes);

 private:
  double bytes_per_second_;
  std::function<Clock::time_point()> now_;
  std::function<void(std::chrono::nanoseconds)> wait_;
  std::mutex mutex_;
  Clock::time_point free_at_;  // when all that was granted has been paid for
};

}  // namespace raystage::store
