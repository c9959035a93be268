// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <sys/resource.h>

#include <algorithm>
#include <chrono>
#include <cstddef>
#include <latch>
#include <new>
#include <stop_token>
#include <thread>

#include "base/resources.h"
#include "ingest/record/memory_budget.h"

namespace raystage::ingest {

/// Keeps the memory of the whole process below a ceiling while it exists; one at a time. Three
/// levels below the ceiling, each a margin apart:
///   lowest: memory that the C library keeps for later is returned to the system;
///   second: allocations of libraries fail (RLIMIT_DATA). A source that grows without bound fails
///           here, before it takes what the frames of other cameras need;
///   third:  no new frames are admitted, and allocations of this program fail as well.
class MemoryCeiling {
 public:
  /// Returns the distance of the levels for a ceiling, bytes: 1/32, at least 8 MiB.
  static constexpr std::size_t margin(std::size_t ceiling) {
    constexpr std::size_t kLeast = 8 << 20, kFraction = 32;
    return std::max(kLeast, ceiling / kFraction);
  }
  /// Returns the memory below the lowest level, which a recording may plan with; bytes.
  static constexpr std::size_t usable(std::size_t ceiling) {
    return ceiling - std::min(ceiling, kLevels * margin(ceiling));
  }
  /// Returns the smallest ceiling of which `memory` is usable, rounded up a little; bytes.
  static constexpr std::size_t needed(std::size_t memory) {
    constexpr std::size_t kLeast = kLevels * (8 << 20);
    return std::max(memory + kLeast, memory + memory / 9);
  }

  /// `frames`: is closed at the third level. `limit_allocations`: false if a library would end the
  /// process when an allocation fails; then the second level is left out.
  MemoryCeiling(std::size_t ceiling, MemoryBudget& frames, bool limit_allocations);
  /// Restores the limits of before.
  ~MemoryCeiling();
  MemoryCeiling(const MemoryCeiling&) = delete;
  MemoryCeiling& operator=(const MemoryCeiling&) = delete;

 private:
  static constexpr std::size_t kLevels = 3;
  void watch(const std::stop_token& stop);
  void look();

  const std::size_t ceiling_, margin_;
  MemoryBudget& frames_;
  const bool limit_allocations_;
  const MemoryUseReader reader_;
  std::new_handler handler_before_ = nullptr;
  std::chrono::steady_clock::time_point trimmed_;
  std::latch holds_{1};
  std::jthread watcher_;  // last: it uses all of the above
};

}  // namespace raystage::ingest
