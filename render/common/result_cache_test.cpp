// SPDX-License-Identifier: Apache-2.0
#include "render/common/result_cache.h"

#include <gtest/gtest.h>
#include <tbb/blocked_range.h>
#include <tbb/parallel_for.h>
#include <tbb/task_arena.h>

#include <atomic>
#include <chrono>
#include <mutex>
#include <set>
#include <stdexcept>
#include <thread>
#include <vector>

namespace raystage::render {
namespace {

/// Requests a result of `size` bytes and counts how often it is computed.
int get(ResultCache& kept, const std::string& key, int value, std::size_t size,
        std::atomic<int>& made) {
  return *kept.get<int>(key, [&](std::size_t& bytes) {
    ++made;
    bytes = size;
    return std::make_shared<const int>(value);
  });
}

TEST(ResultCache, AreMadeOnce) {
  ResultCache kept(100);
  std::atomic<int> made = 0;
  EXPECT_EQ(get(kept, "a", 1, 10, made), 1);
  EXPECT_EQ(get(kept, "a", 2, 10, made), 1);
  EXPECT_EQ(get(kept, "b", 3, 10, made), 3);
  EXPECT_EQ(made, 2);
  EXPECT_EQ(kept.bytes_held(), 20U);
}

TEST(ResultCache, LeastRecentlyUsedGoFirstWhenTheBoundIsReached) {
  ResultCache kept(100);
  std::atomic<int> made = 0;
  get(kept, "a", 1, 50, made);
  get(kept, "b", 2, 50, made);
  get(kept, "a", 1, 50, made);
  get(kept, "c", 3, 50, made);
  EXPECT_EQ(kept.bytes_held(), 100U);
  EXPECT_EQ(made, 3);
  EXPECT_EQ(get(kept, "a", 9, 50, made), 1) << "was used after b";
  EXPECT_EQ(get(kept, "b", 9, 50, made), 9) << "had gone";
}

TEST(ResultCache, OneThatIsLargerThanTheBoundIsUsedAllTheSame) {
  ResultCache kept(100);
  std::atomic<int> made = 0;
  EXPECT_EQ(get(kept, "a", 1, 1000, made), 1);
  EXPECT_EQ(get(kept, "b", 2, 10, made), 2);
  EXPECT_EQ(kept.bytes_held(), 10U);
}

TEST(ResultCache, WhatHoldsNothingStays) {
  ResultCache kept(100);
  std::atomic<int> made = 0;
  get(kept, "choice", 1, 0, made);
  for (const char* key : {"a", "b", "c"}) get(kept, key, 2, 90, made);
  EXPECT_EQ(get(kept, "choice", 9, 0, made), 1);
  EXPECT_EQ(kept.bytes_held(), 90U);
}

TEST(ResultCache, WhatIsInUseOutlivesItsPlace) {
  ResultCache kept(10);
  std::atomic<int> made = 0;
  const auto held = kept.get<int>("a", [](std::size_t& bytes) {
    bytes = 10;
    return std::make_shared<const int>(5);
  });
  get(kept, "b", 2, 10, made);
  EXPECT_EQ(*held, 5);
}

TEST(ResultCache, AFailureIsNotKept) {
  ResultCache kept(100);
  std::atomic<int> made = 0;
  EXPECT_THROW(
      kept.get<int>(
          "a", [](std::size_t&) -> std::shared_ptr<const int> { throw std::runtime_error("no"); }),
      std::runtime_error);
  EXPECT_EQ(get(kept, "a", 1, 10, made), 1);
}

TEST(ResultCache, ManyThreadsMakeAResultOnce) {
  ResultCache kept(1000);
  std::atomic<int> made = 0;
  std::vector<std::jthread> threads;
  for (int i = 0; i < 8; ++i) {
    threads.emplace_back([&] { EXPECT_EQ(get(kept, "a", 1, 10, made), 1); });
  }
  threads.clear();
  EXPECT_EQ(made, 1);
}

TEST(ResultCache, WhoWaitsHelps) {
  // Two frames in flight request the same result, as in a shot of one instant.
  tbb::task_arena arena(2);
  ResultCache kept(100);
  std::mutex mutex;
  std::set<std::thread::id> threads;
  const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(20);
  std::atomic<int> made = 0;
  const auto make = [&](std::size_t& bytes) {
    ++made;
    bytes = 1;
    tbb::parallel_for(0, 64, [&](int) {
      for (;;) {  // until two threads compute
        const std::scoped_lock lock(mutex);
        threads.insert(std::this_thread::get_id());
        if (threads.size() > 1 || std::chrono::steady_clock::now() > deadline) return;
      }
    });
    return std::make_shared<const int>(7);
  };
  arena.execute([&] {
    tbb::parallel_for(
        tbb::blocked_range<int>(0, 2, 1),
        [&](const tbb::blocked_range<int>&) { EXPECT_EQ(*kept.get<int>("depths", make), 7); },
        tbb::simple_partitioner());
  });
  EXPECT_EQ(made, 1);
  EXPECT_EQ(threads.size(), 2U);
}

}  // namespace
}  // namespace raystage::render
