// SPDX-License-Identifier: Apache-2.0
#include "base/parallel.h"

#include <gtest/gtest.h>

#include <atomic>
#include <stdexcept>
#include <vector>

namespace raystage {
namespace {

struct Failure : std::runtime_error {
  using std::runtime_error::runtime_error;
};

TEST(Parallel, VisitsEveryIndexOnce) {
  std::vector<int> visits(1000), row_visits(1000);
  raystage::parallel_for(std::size_t{0}, visits.size(), [&](std::size_t i) { ++visits[i]; });
  raystage::parallel_for(tbb::blocked_range<int>(0, 1000),
                         [&](const tbb::blocked_range<int>& part) {
                           for (int row = part.begin(); row != part.end(); ++row) ++row_visits[row];
                         });
  EXPECT_EQ(visits, std::vector<int>(1000, 1));
  EXPECT_EQ(row_visits, std::vector<int>(1000, 1));
}

TEST(Parallel, TheFirstErrorReachesTheCaller) {
  for (int repeat = 0; repeat < 100; ++repeat) {
    try {
      raystage::parallel_for(0, 100, [&](int i, const ParallelLoop& loop) {
        if (i == 37) throw Failure("thirty-seven");
        if (loop.failed()) throw Failure("a consequence");
      });
      FAIL() << "no error";
    } catch (const Failure& failure) {
      EXPECT_STREQ(failure.what(), "thirty-seven");
    }
  }
}

TEST(Parallel, NothingStartsAfterAnError) {
  std::atomic<int> started = 0;
  EXPECT_THROW(parallel_for_in_order(
                   1000, 2, [] { return false; },
                   [&](std::size_t) {
                     ++started;
                     throw Failure("at once");
                   }),
               Failure);
  EXPECT_LE(started, 2);
}

// TBB cancels the loops nested in a failed loop, and their callers cannot detect that.
TEST(Parallel, AnErrorLeavesNoLoopHalfDone) {
  for (int repeat = 0; repeat < 50; ++repeat) {
    std::atomic<int> half_done = 0;
    EXPECT_THROW(raystage::parallel_for(0, 8,
                                        [&](int outer) {
                                          if (outer == 5) throw Failure("five");
                                          std::atomic<int> inner_done = 0;
                                          raystage::parallel_for(0, 2000,
                                                                 [&](int) { ++inner_done; });
                                          if (inner_done != 2000) ++half_done;
                                        }),
                 Failure);
    EXPECT_EQ(half_done, 0);
  }
}

TEST(Parallel, InFlightStartsInOrderAndStopsWhenTold) {
  std::atomic<int> done = 0;
  parallel_for_in_order(
      100, 3, [&] { return done >= 10; }, [&](std::size_t) { ++done; });
  EXPECT_GE(done, 10);
  EXPECT_LE(done, 13);
}

}  // namespace
}  // namespace raystage
