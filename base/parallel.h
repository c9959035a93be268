// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_pipeline.h>

#include <atomic>
#include <concepts>
#include <cstddef>
#include <exception>
#include <utility>

namespace raystage {

/// One parallel loop: what TBB's loops leave to chance.
///
/// What the caller wrote before a loop is seen by its tasks, and what they wrote is seen by the
/// caller after it. TBB promises the same; spelled out in atomics of our own, the thread sanitizer
/// sees it too, though Debian's TBB is not built for it.
///
/// An error never crosses TBB: TBB would cancel the loop, and with it, unasked, every loop inside
/// it, Embree's among them, which then return half done (and TBB 2021.8 may crash on the way).
/// Here tasks under way finish, no further body starts, and the first error reaches the caller.
class ParallelLoop {
 public:
  ParallelLoop() { forked_.store(1, std::memory_order_release); }
  ParallelLoop(const ParallelLoop&) = delete;
  ParallelLoop& operator=(const ParallelLoop&) = delete;

  /// Within a task: body(), unless one has failed already.
  template <class Body>
  void run(const Body& body) {
    if (forked_.load(std::memory_order_acquire) == 0 || failed()) return;
    try {
      body();
    } catch (...) {
      if (!failed_.exchange(true, std::memory_order_acq_rel)) error_ = std::current_exception();
    }
    joined_.fetch_add(1, std::memory_order_release);
  }

  bool failed() const { return failed_.load(std::memory_order_relaxed); }

  /// After the loop. Throws: what the first failed body threw.
  void join() {
    joined_.load(std::memory_order_acquire);
    if (error_) std::rethrow_exception(error_);
  }

 private:
  std::atomic<int> forked_ = 0, joined_ = 0;
  std::atomic<bool> failed_ = false;
  std::exception_ptr error_;
};

/// tbb::parallel_for over a range of rows: body(part).
template <class Body>
void parallel_for(const tbb::blocked_range<int>& range, const Body& body) {
  ParallelLoop loop;
  tbb::parallel_for(range,
                    [&](const tbb::blocked_range<int>& part) { loop.run([&] { body(part); }); });
  loop.join();
}

/// tbb::parallel_for over [first, last): body(index), or body(index, loop) where a long body wants
/// to know that another has failed.
template <class Index, class Body>
void parallel_for(Index first, Index last, const Body& body) {
  ParallelLoop loop;
  tbb::parallel_for(first, last, [&](Index index) {
    loop.run([&] {
      if constexpr (std::invocable<const Body&, Index, const ParallelLoop&>) {
        body(index, std::as_const(loop));
      } else {
        body(index);
      }
    });
  });
  loop.join();
}

/// body(index) for [0, count) in order of start, at most `in_flight` at once; stops starting more
/// as soon as `stopped()` says so.
template <class Stopped, class Body>
void parallel_for_in_order(std::size_t count, std::size_t in_flight, const Stopped& stopped,
                           const Body& body) {
  std::atomic<std::size_t> next = 0;
  ParallelLoop loop;
  tbb::parallel_pipeline(
      in_flight,
      tbb::make_filter<void, std::size_t>(tbb::filter_mode::serial_in_order,
                                          [&](tbb::flow_control& control) -> std::size_t {
                                            if (next < count && !loop.failed() && !stopped())
                                              return next++;
                                            control.stop();
                                            return 0;
                                          }) &
          tbb::make_filter<std::size_t, void>(tbb::filter_mode::parallel, [&](std::size_t index) {
            loop.run([&] { body(index); });
          }));
  loop.join();
}

}  // namespace raystage
