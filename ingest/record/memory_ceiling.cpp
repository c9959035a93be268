// SPDX-License-Identifier: Apache-2.0
// Watches the resident memory of the process and moves the soft RLIMIT_DATA along, so that the
// memory that may still be allocated is what is missing to the second level. Allocations by
// operator new that fail there get memory up to the third level by the new handler: these are our
// frames and records. Libraries allocate by malloc and get an error. Cost: one read of
// /proc/self/statm and one setrlimit() every 10 ms.
#include "ingest/record/memory_ceiling.h"

#include <malloc.h>

#include <cassert>
#include <mutex>

namespace raystage::ingest {
namespace {

using namespace std::chrono_literals;

constexpr auto kWatchInterval = 10ms;
constexpr auto kTrimInterval = 250ms;
constexpr std::size_t kLoan = 1 << 20;

std::size_t difference(std::size_t a, std::size_t b) { return a > b ? a - b : 0; }

/// What the new handler uses. A thread may be in the handler when the ceiling ends, so this lives
/// as long as the process. Nothing here allocates.
struct Loans {
  std::mutex mutex;  // of all below
  bool active = false;
  rlimit before{};
  std::size_t data_limit = 0, rest = 0;  // rest: that allocations of this program may still get

  bool limit_data() const {
    const rlimit limit{std::min<rlim_t>(data_limit, before.rlim_cur), before.rlim_max};
    return setrlimit(RLIMIT_DATA, &limit) == 0;
  }
};

// A new handler is a plain function.
Loans& loans() {
  static Loans only;
  return only;
}

/// Raises the limit for an allocation of this program, which is then tried again. Throws bad_alloc
/// at the third level.
void handle_failed_new() {
  Loans& from = loans();
  const std::scoped_lock lock(from.mutex);
  if (!from.active) {  // it ended meanwhile: tried again without a limit, and without this handler
    if (std::get_new_handler() == handle_failed_new) throw std::bad_alloc();
    return;
  }
  if (from.rest < kLoan) throw std::bad_alloc();
  from.rest -= kLoan;
  from.data_limit += kLoan;
  if (!from.limit_data()) throw std::bad_alloc();
}

}  // namespace

MemoryCeiling::MemoryCeiling(std::size_t ceiling, MemoryBudget& frames, bool limit_allocations)
    : ceiling_(ceiling),
      margin_(margin(ceiling)),
      frames_(frames),
      limit_allocations_(limit_allocations) {
  // Before a limit holds under which no thread can be started.
  watcher_ = std::jthread([this](const std::stop_token& stop) {
    holds_.wait();
    watch(stop);
  });
  if (limit_allocations_) {
    Loans& own = loans();
    const std::scoped_lock lock(own.mutex);
    assert(!own.active);
    getrlimit(RLIMIT_DATA, &own.before);
    own.data_limit = static_cast<std::size_t>(own.before.rlim_cur);
    own.rest = 0;
    own.active = true;
    handler_before_ = std::set_new_handler(handle_failed_new);
  }
  look();
  holds_.count_down();
}

MemoryCeiling::~MemoryCeiling() {
  watcher_ = {};  // joins
  frames_.set_open(true);
  if (!limit_allocations_) return;
  Loans& own = loans();
  const std::scoped_lock lock(own.mutex);
  std::set_new_handler(handler_before_);  // first: see handle_failed_new()
  own.active = false;
  setrlimit(RLIMIT_DATA, &own.before);
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
    Loans& own = loans();
    const std::scoped_lock lock(own.mutex);
    own.data_limit = use->data + difference(second, use->resident);
    own.rest = difference(third, std::max(second, use->resident));
    own.limit_data();
  }
  if (use->resident > third) frames_.set_open(false);
  if (use->resident <= second) frames_.set_open(true);
}

}  // namespace raystage::ingest
