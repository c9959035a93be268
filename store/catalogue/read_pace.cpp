// SPDX-License-Identifier: Apache-2.0
// A token bucket, kept as the time at which it would be full again: bytes move that time ahead, and
// who comes before it by more than the bucket holds waits.
#include "store/catalogue/read_pace.h"

#include <algorithm>
#include <thread>
#include <utility>

namespace raystage::store {

namespace {
constexpr auto kBucket = std::chrono::milliseconds(250);
}  // namespace

ReadPace::ReadPace(double bytes_per_second, std::function<Clock::time_point()> now,
                   std::function<void(std::chrono::nanoseconds)> wait)
    : bytes_per_second_(bytes_per_second), now_(std::move(now)), wait_(std::move(wait)) {
  if (!wait_) wait_ = [](std::chrono::nanoseconds time) { std::this_thread::sleep_for(time); };
  free_at_ = now_() - kBucket;
}

void ReadPace::before(std::uint64_t bytes) {
  if (bytes_per_second_ <= 0) return;
  const std::chrono::duration<double> cost(static_cast<double>(bytes) / bytes_per_second_);
  std::chrono::nanoseconds pause{};
  {
    const std::scoped_lock lock(mutex_);
    const Clock::time_point now = now_();
    free_at_ = std::max(free_at_, now - kBucket);
    pause = free_at_ - now;
    free_at_ += std::chrono::duration_cast<Clock::duration>(cost);
  }
  if (pause.count() > 0) wait_(pause);
}

}  // namespace raystage::store
