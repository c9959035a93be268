// SPDX-License-Identifier: Apache-2.0
#include "farm/job_plan.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <algorithm>
#include <numeric>

#include "testing/farm/test_job.h"

namespace raystage::farm {
namespace {

using ::testing::ElementsAre;

TEST(JobPlan, EveryFrameIsInOneChunk) {
  rc::check([] {
    const int count = *rc::gen::inRange(1, 300), per_chunk = *rc::gen::inRange(1, 60);
    std::vector<int> frames(static_cast<std::size_t>(count));
    std::iota(frames.begin(), frames.end(), *rc::gen::inRange(-50, 1000));
    const auto chunks = split_into_chunks(frames, {per_chunk, *rc::gen::arbitrary<bool>()});
    std::vector<int> all;
    for (const auto& chunk : chunks) {
      RC_ASSERT(!chunk.empty() && chunk.size() <= std::size_t(per_chunk));
      RC_ASSERT(std::ranges::is_sorted(chunk));
      all.insert(all.end(), chunk.begin(), chunk.end());
    }
    std::ranges::sort(all);
    RC_ASSERT(all == frames);
  });
}

TEST(JobPlan, EveryTenthFrameComesFirst) {
  std::vector<int> frames(30);
  std::iota(frames.begin(), frames.end(), 1);
  const auto chunks = split_into_chunks(frames, {4, true});
  EXPECT_THAT(chunks[0], ElementsAre(1, 11, 21));
  EXPECT_THAT(chunks[1], ElementsAre(2, 3, 4, 5));
}

TEST(JobPlan, TasksLastMinutesAndStayManyEnough) {
  EXPECT_EQ(automatic_chunk_size(1000, 1.0), 62) << "16 tasks to share out";
  EXPECT_EQ(automatic_chunk_size(100'000, 1.0), 300) << "five minutes";
  EXPECT_EQ(automatic_chunk_size(48, 0.1), 48) << "not worth sharing";
  EXPECT_EQ(automatic_chunk_size(48, 3600.0), 1);
  EXPECT_EQ(automatic_chunk_size(0, 0.0), 1);
}

TEST(JobPlan, AChunkWaitsOnlyForItsInstants) {
  const schemas::FarmJobDocument job = testing::make_small_job();
  const schemas::FarmRound round = testing::first_round();
  const auto groups = group_chunks(job, round.prepare, round.render);
  ASSERT_EQ(groups.size(), 3U);
  EXPECT_THAT(groups[0].instants, ElementsAre(0));
  EXPECT_THAT(groups[0].chunks, ElementsAre(0, 1));
  EXPECT_THAT(groups[1].instants, ElementsAre(1));
  EXPECT_THAT(groups[2].instants, ElementsAre());
  EXPECT_THAT(groups[2].chunks, ElementsAre(3));
  // Chunks do not wait for what is stored already.
  const std::vector<int> only_second{1};
  const auto later = group_chunks(job, only_second, round.render);
  ASSERT_EQ(later.size(), 2U);
  EXPECT_THAT(later[0].chunks, ElementsAre(0, 1, 3));
}

TEST(JobPlan, LongMovesTakeABoundedNumberOfSubmissions) {
  schemas::FarmJobDocument job = testing::make_small_job();
  job.chunks.clear();
  job.instants.assign(1000, job.instants[0]);
  std::vector<int> all(1000);
  std::iota(all.begin(), all.end(), 0);
  for (int i = 0; i < 1000; ++i) job.chunks.push_back({std::to_string(i), {i}});
  const auto groups = group_chunks(job, all, all);
  EXPECT_EQ(groups.size(), 100U);
  std::vector<int> seen;
  for (const ChunkGroup& group : groups) {
    EXPECT_EQ(group.instants, group.chunks);
    seen.insert(seen.end(), group.chunks.begin(), group.chunks.end());
  }
  EXPECT_EQ(seen, all);
}

TEST(JobPlan, ArraysAreSplitAtTheLargestIndex) {
  const std::vector<int> indices{0, 1, 9, 10, 11, 25};
  const auto parts = split_array(indices, 10);
  ASSERT_EQ(parts.size(), 3U);
  EXPECT_THAT(parts[0].indices, ElementsAre(0, 1, 9));
  EXPECT_EQ(parts[1].offset, 10);
  EXPECT_THAT(parts[1].indices, ElementsAre(0, 1));
  EXPECT_EQ(parts[2].offset, 20);
  EXPECT_THAT(parts[2].indices, ElementsAre(5));
}

}  // namespace
}  // namespace raystage::farm
