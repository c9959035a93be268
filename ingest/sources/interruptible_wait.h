// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <mutex>

namespace raystage::ingest {

/// Waits until a time or until another thread interrupts it.
class InterruptibleWait {
 public:
  using Clock = std::chrono::steady_clock;

  /// Sleeps until `time`; returns false as soon as interrupt() is called. Each interrupt() ends one
  /// wait: the current one, or else the next.
  bool until(Clock::time_point time) {
    std::unique_lock lock(mutex_);
    const bool cut_short = changed_.wait_until(lock, time, [this] { return interrupted_; });
    interrupted_ = false;
    return !cut_short;
  }

  void interrupt() {
    {
      const std::scoped_lock lock(mutex_);
      interrupted_ = true;
    }
    changed_.notify_all();
  }

  /// Forgets an interrupt() that ended another wait.
  void forget() {
    const std::scoped_lock lock(mutex_);
    interrupted_ = false;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  bool interrupted_ = false;
};

}  // namespace raystage::ingest
