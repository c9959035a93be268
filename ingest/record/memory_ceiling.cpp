// SPDX-License-Identifier: Apache-2.0
// Watches the resident memory of the process and moves the soft RLIMIT_DATA along, so that the
// memory that may still be allocated is what is missing to the second level. Allocations by
// operator new that fail there get memory up to the third level by the new handler: these are our
// frames and records. Libraries allocate by malloc and get an error. Cost: one read of
// /proc/self/statm and one setrlimit() every 10 ms.
#include "ingest/record/memory_ceiling.h"

#include <malloc.h>

#include <atomic>
#include <cassert>

namespace raystage::ingest {
namespace {

using namespace std::chrono_literals;

constexpr auto kWatchInterval = 10ms;
constexpr auto kTrimInterval = 250ms;
constexpr std::size_t kLoan = 1 << 20;

// A new handler is a plain function.
std::atomic<MemoryCeiling*>& active_ceiling() {
  static std::atomic<MemoryCeiling*> active = nullptr;
  return active;
}

std::size_t difference(std::size_t a, std::size_t b) { return a > b ? a - b : 0; }

}  // namespace

MemoryCeiling::MemoryCeiling(std::size_t ceiling, MemoryBudget& frames, bool limit_allocations)
    : ceiling_(ceiling),
      margin_(margin(ceiling)),
      frames_(frames),
      limit_allocations_(limit_allocations) {
  getrlimit(RLIMIT_DATA, &limit_before_);
  look();
  if (limit_allocations_) {
    [[maybe_unused]] const MemoryCeiling* other = active_ceiling().exchange(this);
    assert(other == nullptr);
    handler_before_ = std::set_new_handler(handle_failed_new);
  }
  watcher_ = std::jthread([this](const std::stop_token& stop) { watch(stop); });
}

MemoryCeiling::~MemoryCeiling() {
  watcher_ = {};  // joins
  frames_.set_open(true);
  if (!limit_allocations_) return;
  std::set_new_handler(handler_before_);
  active_ceiling() = nullptr;
  setrlimit(RLIMIT_DATA, &limit_before_);
}

void MemoryCeiling::watch(const std::stop_token& stop) {
  while (!stop.stop_requested()) {
    look();
    std::this_thread::sleep_for(kWatchInterval);
  }
}

void MemoryCeiling::look() {
  const auto now = std::chrono::steady_clock::now();
  auto use = reader_.read();
  if (!use) return;
  if (use->resident > usable(ceiling_) && now - trimmed_ > kTrimInterval) {
    trimmed_ = now;
    malloc_trim(0);
    use = reader_.read();
    if (!use) return;
  }
  const std::size_t second = difference(ceiling_, 2 * margin_),
                    third = difference(ceiling_, margin_);
  if (limit_allocations_) {
    const std::scoped_lock lock(mutex_);
    data_limit_ = use->data + difference(second, use->resident);
    rest_ = difference(third, std::max(second, use->resident));
    limit_data(data_limit_);
  }
  if (use->resident > third) frames_.set_open(false);
  if (use->resident <= second) frames_.set_open(true);
}

bool MemoryCeiling::limit_data(std::size_t bytes) const {
  const rlimit limit{std::min<rlim_t>(bytes, limit_before_.rlim_cur), limit_before_.rlim_max};
  return setrlimit(RLIMIT_DATA, &limit) == 0;
}

/// Raises the limit for an allocation of this program. Returns false at the third level.
bool MemoryCeiling::lend() {
  const std::scoped_lock lock(mutex_);
  if (rest_ < kLoan) return false;
  rest_ -= kLoan;
  data_limit_ += kLoan;
  return limit_data(data_limit_);
}

void MemoryCeiling::handle_failed_new() {
  MemoryCeiling* const ceiling = active_ceiling();
  if (ceiling == nullptr || !ceiling->lend()) throw std::bad_alloc();
}

}  // namespace raystage::ingest
