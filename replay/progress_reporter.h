// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <chrono>
#include <condition_variable>
#include <functional>
#include <mutex>
#include <thread>

namespace raystage::replay {

/// Calls a function on a thread of its own, five times per second, until it is destroyed.
class ProgressReporter {
 public:
  explicit ProgressReporter(std::function<void()> report)
      : thread_([this, report = std::move(report)](const std::stop_token& stop) {
          constexpr std::chrono::milliseconds kInterval{200};
          std::unique_lock lock(mutex_);
          while (!wait_.wait_for(lock, stop, kInterval, [&] { return stop.stop_requested(); })) {
            report();
          }
        }) {}

 private:
  std::mutex mutex_;
  std::condition_variable_any wait_;
  std::jthread thread_;  // the last member: it ends first
};

}  // namespace raystage::replay
