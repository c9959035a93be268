// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_pipeline.h>

#include <atomic>
#include <concepts>
#include <cstddef>
#include <exception>
#include <stop_token>
#include <utility>

#include "base/cancellation.h"

namespace raystage {

/// Memory order and error handling of one parallel loop on TBB.
///
/// Tasks see the caller's writes before the loop; the caller sees the tasks' writes after it. TBB
/// guarantees the same, but Debian's TBB is not built for the thread sanitizer. The atomics here
/// make the order visible to it.
///
/// Exceptions never pass through TBB. TBB would cancel the loop and every loop nested in it,
/// including Embree's, which then return incomplete results (TBB 2021.8 may also crash). Here
/// running tasks finish, no further body starts, and the caller receives the first exception.
///
/// Bodies run in the caller's CancellationScope. Once that is cancelled no further body starts, and
/// the caller receives Cancelled.
class ParallelLoop {
 public:
  ParallelLoop() : cancellation_(current_cancellation()) {
    forked_.store(1, std::memory_order_release);
  }
  ParallelLoop(const ParallelLoop&) = delete;
  ParallelLoop& operator=(const ParallelLoop&) = delete;

  /// Runs body() unless another body has failed. Call it within a task.
  template <class Body>
  void run(const Body& body) {
    if (forked_.load(std::memory_order_acquire) == 0 || failed()) return;
    const CancellationScope scope(cancellation_);
    try {
      body();
    } catch (...) {
      if (!failed_.exchange(true, std::memory_order_acq_rel)) error_ = std::current_exception();
    }
    joined_.fetch_add(1, std::memory_order_release);
  }

  /// Returns whether the loop should end early: a body has failed, or the loop was cancelled.
  bool failed() const {
    return failed_.load(std::memory_order_relaxed) || cancellation_.stop_requested();
  }

  /// Rethrows the exception of the first body that failed, or throws Cancelled. Call it after the
  /// loop.
  void join() {
    joined_.load(std::memory_order_acquire);
    if (error_) std::rethrow_exception(error_);
    if (cancellation_.stop_requested()) throw Cancelled();
  }

 private:
  std::atomic<int> forked_ = 0, joined_ = 0;
  std::atomic<bool> failed_ = false;
  std::exception_ptr error_;
  std::stop_token cancellation_;
};

/// Runs tbb::parallel_for over a range of rows: body(part).
template <class Body>
void parallel_for(const tbb::blocked_range<int>& range, const Body& body) {
  ParallelLoop loop;
  tbb::parallel_for(range,
                    [&](const tbb::blocked_range<int>& part) { loop.run([&] { body(part); }); });
  loop.join();
}

/// Runs body(index) over [first, last), about `grain` successive indices per task.
template <class Body>
void parallel_for_grains(int first, int last, int grain, const Body& body) {
  parallel_for(tbb::blocked_range<int>(first, last, grain),
               [&](const tbb::blocked_range<int>& part) {
                 for (int i = part.begin(); i < part.end(); ++i) body(i);
               });
}

/// Runs tbb::parallel_for over [first, last): body(index), or body(index, loop) for a long body
/// that checks loop.failed() to stop early.
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

/// Runs body(index) for the indices [0, count), started in increasing order, at most `in_flight` at
/// once. Starts no further body once `stopped()` returns true.
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
