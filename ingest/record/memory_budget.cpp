// SPDX-License-Identifier: Apache-2.0
#include "ingest/record/memory_budget.h"

namespace raystage::ingest {

void MemoryBudget::Reservation::shrink_to(std::size_t bytes) {
  if (budget_ == nullptr || bytes >= bytes_) return;
  budget_->used_.fetch_sub(bytes_ - bytes, std::memory_order_relaxed);
  bytes_ = bytes;
  if (bytes == 0) budget_ = nullptr;
}

MemoryBudget::Reservation MemoryBudget::try_reserve(std::size_t bytes) {
  std::size_t used = used_.load(std::memory_order_relaxed);
  do {
    if (bytes > limit_ || used > limit_ - bytes) return {};
  } while (!used_.compare_exchange_weak(used, used + bytes, std::memory_order_relaxed));
  const std::size_t now = used + bytes;
  std::size_t peak = peak_.load(std::memory_order_relaxed);
  while (peak < now && !peak_.compare_exchange_weak(peak, now, std::memory_order_relaxed)) {
  }
  // Notifies only when the limit is crossed, not for each frame.
  if (used <= limit_ / 2 && now > limit_ / 2) {
    { const std::scoped_lock lock(mutex_); }
    pressure_changed_.notify_all();
  }
  return {this, bytes};
}

void MemoryBudget::wait_for_pressure(const std::stop_token& stop,
                                     std::chrono::milliseconds timeout) {
  std::unique_lock lock(mutex_);
  pressure_changed_.wait_for(lock, stop, timeout, [this] { return is_under_pressure(); });
}

}  // namespace raystage::ingest
