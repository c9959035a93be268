// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <chrono>
#include <condition_variable>
#include <cstddef>
#include <mutex>
#include <stop_token>
#include <utility>

namespace raystage::ingest {

/// Limits the bytes of all frames that are in memory at the same time. Thread-safe.
class MemoryBudget {
 public:
  explicit MemoryBudget(std::size_t limit) : limit_(limit) {}

  /// Owns a part of the budget and releases it on destruction.
  class Reservation {
   public:
    Reservation() = default;
    ~Reservation() { shrink_to(0); }
    Reservation(Reservation&& other) noexcept
        : budget_(std::exchange(other.budget_, nullptr)), bytes_(std::exchange(other.bytes_, 0)) {}
    Reservation& operator=(Reservation&& other) noexcept {
      if (this != &other) {
        shrink_to(0);
        budget_ = std::exchange(other.budget_, nullptr);
        bytes_ = std::exchange(other.bytes_, 0);
      }
      return *this;
    }
    explicit operator bool() const { return budget_ != nullptr; }
    std::size_t bytes() const { return bytes_; }
    /// Releases what exceeds `bytes`.
    void shrink_to(std::size_t bytes);

   private:
    friend class MemoryBudget;
    Reservation(MemoryBudget* budget, std::size_t bytes) : budget_(budget), bytes_(bytes) {}
    MemoryBudget* budget_ = nullptr;
    std::size_t bytes_ = 0;
  };

  /// Reserves `bytes` without waiting; returns an empty Reservation if fewer are free.
  Reservation try_reserve(std::size_t bytes);

  /// Returns true if more than half of the budget is used.
  bool is_under_pressure() const { return used() > limit_ / 2; }
  /// Waits until is_under_pressure(), a stop or the timeout.
  void wait_for_pressure(const std::stop_token& stop, std::chrono::milliseconds timeout);

  /// While it is closed, no new frames may be taken into memory; reservations are still given.
  void set_open(bool open) { open_.store(open, std::memory_order_relaxed); }
  bool is_open() const { return open_.load(std::memory_order_relaxed); }

  std::size_t limit() const { return limit_; }
  std::size_t used() const { return used_.load(std::memory_order_relaxed); }
  std::size_t peak() const { return peak_.load(std::memory_order_relaxed); }

 private:
  const std::size_t limit_;
  std::atomic<std::size_t> used_ = 0, peak_ = 0;
  std::atomic<bool> open_ = true;
  std::mutex mutex_;
  std::condition_variable_any pressure_changed_;
};

}  // namespace raystage::ingest
