// SPDX-License-Identifier: Apache-2.0
#include "base/cancellation.h"

#include <gtest/gtest.h>
#include <tbb/task_arena.h>

#include <atomic>
#include <stdexcept>
#include <thread>

#include "base/parallel.h"

namespace raystage {
namespace {

TEST(Cancellation, WithoutAScopeNothingIsCancelled) {
  EXPECT_FALSE(current_cancellation().stop_requested());
  EXPECT_NO_THROW(throw_if_cancelled());
}

TEST(Cancellation, EndsALoopAndStartsNoFurtherBody) {
  std::stop_source source;
  const CancellationScope scope(source.get_token());
  std::atomic<int> bodies = 0;
  EXPECT_THROW(parallel_for(0, 100'000,
                            [&](int) {
                              ++bodies;
                              source.request_stop();
                            }),
               Cancelled);
  EXPECT_LT(bodies, 1000);  // those that other threads had started
  EXPECT_THROW(throw_if_cancelled(), Cancelled);
}

TEST(Cancellation, ReachesLoopsInBodiesOnOtherThreads) {
  std::stop_source source;
  std::atomic<int> inner = 0;
  tbb::task_arena(4).execute([&] {
    const CancellationScope scope(source.get_token());
    EXPECT_THROW(parallel_for(0, 64,
                              [&](int outer) {
                                EXPECT_TRUE(current_cancellation().stop_possible());
                                parallel_for(0, 1000, [&](int i) {
                                  ++inner;
                                  if (outer == 0 && i == 0) source.request_stop();
                                });
                              }),
                 Cancelled);
  });
  EXPECT_LT(inner, 64 * 1000);
}

TEST(Cancellation, LongBodiesCanAskTheLoop) {
  std::stop_source source;
  const CancellationScope scope(source.get_token());
  EXPECT_THROW(parallel_for(0, 4,
                            [&](int, const ParallelLoop& loop) {
                              source.request_stop();
                              while (!loop.failed()) std::this_thread::yield();
                            }),
               Cancelled);
}

TEST(Cancellation, OfAnInnerScopeLeavesTheOuterOneAlone) {
  std::stop_source outer, inner;
  const CancellationScope outer_scope(outer.get_token());
  inner.request_stop();
  {
    const CancellationScope inner_scope(inner.get_token());
    EXPECT_THROW(throw_if_cancelled(), Cancelled);
  }
  EXPECT_NO_THROW(parallel_for(0, 10, [](int) {}));
}

TEST(Cancellation, AnErrorOfABodyIsReportedFirst) {
  std::stop_source source;
  const CancellationScope scope(source.get_token());
  EXPECT_THROW(parallel_for(0, 10,
                            [&](int) {
                              source.request_stop();
                              throw std::runtime_error("damaged");
                            }),
               std::runtime_error);
}

}  // namespace
}  // namespace raystage
