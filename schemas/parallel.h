// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/parallel_pipeline.h>

#include <atomic>
#include <cstddef>

namespace raystage {

/// What the caller wrote before a parallel loop is seen by its tasks, and what they wrote is seen
/// by the caller after it. TBB promises the same; spelled out in atomics of our own, the thread
/// sanitizer sees it too, though Debian's TBB is not built for it.
class ForkAndJoin {
 public:
  ForkAndJoin() { forked_.store(1, std::memory_order_release); }
  ~ForkAndJoin() { joined_.load(std::memory_order_acquire); }
  ForkAndJoin(const ForkAndJoin&) = delete;
  ForkAndJoin& operator=(const ForkAndJoin&) = delete;

  class Task {
   public:
    explicit Task(ForkAndJoin& loop) : loop_(loop) {
      loop_.forked_.load(std::memory_order_acquire);
    }
    ~Task() { loop_.joined_.fetch_add(1, std::memory_order_release); }
    Task(const Task&) = delete;
    Task& operator=(const Task&) = delete;

   private:
    ForkAndJoin& loop_;
  };

 private:
  std::atomic<int> forked_ = 0, joined_ = 0;
};

/// tbb::parallel_for over a range of rows: body(part).
template <class Body>
void parallel_for(const tbb::blocked_range<int>& range, const Body& body) {
  ForkAndJoin loop;
  tbb::parallel_for(range, [&](const tbb::blocked_range<int>& part) {
    const ForkAndJoin::Task task(loop);
    body(part);
  });
}

/// tbb::parallel_for over [first, last): body(index).
template <class Index, class Body>
void parallel_for(Index first, Index last, const Body& body) {
  ForkAndJoin loop;
  tbb::parallel_for(first, last, [&](Index index) {
    const ForkAndJoin::Task task(loop);
    body(index);
  });
}

/// body(index) for [0, count) in order of start, at most `in_flight` at once; stops starting more
/// as soon as `stopped()` says so.
template <class Stopped, class Body>
void for_each_in_flight(std::size_t count, std::size_t in_flight, const Stopped& stopped,
                        const Body& body) {
  std::atomic<std::size_t> next = 0;
  ForkAndJoin loop;
  tbb::parallel_pipeline(
      in_flight,
      tbb::make_filter<void, std::size_t>(tbb::filter_mode::serial_in_order,
                                          [&](tbb::flow_control& control) -> std::size_t {
                                            if (next < count && !stopped()) return next++;
                                            control.stop();
                                            return 0;
                                          }) &
          tbb::make_filter<std::size_t, void>(tbb::filter_mode::parallel, [&](std::size_t index) {
            const ForkAndJoin::Task task(loop);
            body(index);
          }));
}

}  // namespace raystage
