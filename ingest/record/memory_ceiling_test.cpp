// SPDX-License-Identifier: Apache-2.0
#include "ingest/record/memory_ceiling.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/mman.h>

#include <atomic>
#include <chrono>
#include <cstdlib>
#include <memory>
#include <thread>
#include <vector>

#include "base/error.h"
#include "ingest/record/recording_memory_plan.h"

namespace raystage::ingest {
namespace {

using ::testing::HasSubstr;

constexpr std::size_t kMiB = 1 << 20;

std::size_t resident() { return MemoryUseReader().read()->resident; }

TEST(MemoryCeiling, LibrariesFailBeforeThisProgramAndNeitherReachesIt) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers take memory of their own";
#endif
  MemoryBudget frames(kMiB);
  const std::size_t ceiling = resident() + 100 * kMiB, margin = MemoryCeiling::margin(ceiling);
  std::vector<std::unique_ptr<char, void (*)(void*)>> of_libraries;
  std::vector<std::unique_ptr<std::vector<char>>> ours;
  of_libraries.reserve(1000);
  ours.reserve(1000);
  rlimit before{}, after{};
  getrlimit(RLIMIT_DATA, &before);
  {
    const MemoryCeiling limited(ceiling, frames, true);
    const auto allocate = [&] {
      for (;;) {
        auto* memory = static_cast<char*>(std::malloc(kMiB));
        if (memory == nullptr) return;
        std::fill_n(memory, kMiB, 'x');
        of_libraries.emplace_back(memory, std::free);
      }
    };
    allocate();
    std::this_thread::sleep_for(std::chrono::milliseconds(100));
    allocate();  // the limit has followed the memory
    EXPECT_GT(of_libraries.size(), 60U);
    EXPECT_LT(resident(), ceiling - 2 * margin + 2 * kMiB);
    EXPECT_TRUE(frames.is_open());
    EXPECT_THROW(for (;;) ours.push_back(std::make_unique<std::vector<char>>(kMiB / 4, 'x')),
                 std::bad_alloc);
    EXPECT_GT(ours.size(), 8U);
    EXPECT_LT(resident(), ceiling);
    ours.clear();
    of_libraries.clear();
    std::this_thread::sleep_for(std::chrono::milliseconds(400));
    EXPECT_LT(resident(), ceiling - 60 * kMiB) << "freed memory was not returned";
    EXPECT_TRUE(frames.is_open());
  }
  getrlimit(RLIMIT_DATA, &after);
  EXPECT_EQ(after.rlim_cur, before.rlim_cur);
}

// As the writers' threads do at the end of a recording.
TEST(MemoryCeiling, MayEndWhileOtherThreadsAllocate) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers take memory of their own";
#endif
  MemoryBudget frames(kMiB);
  rlimit before{}, after{};
  getrlimit(RLIMIT_DATA, &before);
  std::atomic<int> failed = 0;
  constexpr int kRounds = 20;
  for (int round = 0; round < kRounds; ++round) {
    auto limited = std::make_unique<MemoryCeiling>(resident() + 48 * kMiB, frames, true);
    std::atomic<bool> has_ended = false;
    const int failed_before = failed;
    const std::jthread allocates([&] {
      std::vector<std::unique_ptr<std::vector<char>>> held;
      while (!has_ended) {
        try {
          held.push_back(std::make_unique<std::vector<char>>(kMiB / 4, 'x'));
        } catch (const std::bad_alloc&) {
          ++failed;
          held.clear();
        }
      }
    });
    const auto deadline = std::chrono::steady_clock::now() + std::chrono::seconds(1);
    while (failed == failed_before && std::chrono::steady_clock::now() < deadline) {
      std::this_thread::yield();
    }
    limited = nullptr;
    has_ended = true;
  }
  EXPECT_GT(failed, 0);
  getrlimit(RLIMIT_DATA, &after);
  EXPECT_EQ(after.rlim_cur, before.rlim_cur);
}

// Where an allocation must not fail, frames are refused instead. Mapped files count as well.
TEST(MemoryCeiling, FramesAreNotAdmittedJustBelowIt) {
  MemoryBudget frames(kMiB);
  constexpr std::size_t kSize = 64 * kMiB;
  const MemoryCeiling limited(resident() + kSize, frames, false);
  EXPECT_TRUE(frames.is_open());
  void* const mapped = mmap(nullptr, kSize, PROT_READ | PROT_WRITE,
                            MAP_SHARED | MAP_ANONYMOUS | MAP_POPULATE, -1, 0);
  ASSERT_NE(mapped, MAP_FAILED);
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  EXPECT_FALSE(frames.is_open());
  munmap(mapped, kSize);
  std::this_thread::sleep_for(std::chrono::milliseconds(100));
  EXPECT_TRUE(frames.is_open());
}

TEST(MemoryCeiling, ARecordingThatMayNeedMoreIsRefused) {
  const RecordingMemoryPlan plan{200'000'000, 100'000'000};
  const std::size_t needed = MemoryCeiling::needed(300'000'000);
  EXPECT_GE(MemoryCeiling::usable(needed), 300'000'000U);
  EXPECT_NO_THROW(check_memory_ceiling(plan, needed));
  try {
    check_memory_ceiling(plan, 250'000'000);
    ADD_FAILURE() << "accepted";
  } catch (const Error& error) {
    EXPECT_EQ(error.exit_code(), ExitCode::kBadInput);
    EXPECT_THAT(error.what(), HasSubstr("a ceiling of 250 MB leaves 225 MB"));
    EXPECT_THAT(error.what(), HasSubstr("or reduce memory_mb to 124"));
  }
}

}  // namespace
}  // namespace raystage::ingest
