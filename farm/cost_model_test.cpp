// SPDX-License-Identifier: Apache-2.0
#include "farm/cost_model.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "farm/cost_page.h"
#include "testing/farm/test_job.h"

namespace raystage::farm {
namespace {

JobCosts costs() {
  JobCosts job;
  job.frames = 1000;
  job.chunks = 500;
  job.threads = 2;
  job.frame_s = 2;
  return job;
}

SiteParameters site() {
  SiteParameters site;
  site.start_latency_s = 0;
  site.starts_per_s = 1e9;
  site.storage_read_bytes_per_s = site.storage_write_bytes_per_s = 1e12;
  return site;
}

TEST(CostModel, ScalesWithNodesUntilTasksRunOut) {
  const ScalingPrediction one = predict_scaling(costs(), site(), 1),
                          ten = predict_scaling(costs(), site(), 10);
  EXPECT_DOUBLE_EQ(one.seconds, 2000);  // 500 tasks of two frames of 2 s
  EXPECT_DOUBLE_EQ(ten.seconds, 200);
  EXPECT_DOUBLE_EQ(ten.efficiency, 1);
  EXPECT_EQ(ten.limit, CostLimit::kProcessors);
  const ScalingPrediction many = predict_scaling(costs(), site(), 1000);
  EXPECT_DOUBLE_EQ(many.seconds, 4);
  EXPECT_EQ(many.limit, CostLimit::kTooFewTasks);
}

TEST(CostModel, NamesWhatSaturates) {
  SiteParameters slow = site();
  slow.starts_per_s = 10;
  EXPECT_EQ(predict_scaling(costs(), slow, 1000).limit, CostLimit::kScheduler);
  EXPECT_DOUBLE_EQ(predict_scaling(costs(), slow, 1000).render_s, 50);
  JobCosts large = costs();
  large.frame_write_bytes = 1e9;
  SiteParameters disk = site();
  disk.storage_write_bytes_per_s = 1e9;
  EXPECT_EQ(predict_scaling(large, disk, 100).limit, CostLimit::kStorageWrite);
  EXPECT_EQ(predict_scaling(large, disk, 1).limit, CostLimit::kProcessors);
  JobCosts slow_check = costs();
  slow_check.verify_s = 1;
  EXPECT_EQ(predict_scaling(slow_check, site(), 100).limit, CostLimit::kSerial);
}

TEST(CostModel, LatencyCountsForEveryWaveAndThroughputForTheWhole) {
  SiteParameters late = site();
  late.start_latency_s = 1;
  EXPECT_DOUBLE_EQ(predict_scaling(costs(), late, 10).render_s, 50 * (4 + 1));
}

TEST(CostModel, MeasuresAJobByItsRecords) {
  schemas::FarmJobDocument job = testing::make_small_job();
  TaskAttempts attempts;
  EXPECT_FALSE(measured_costs(job, attempts)) << "nothing has run";
  Nanoseconds now = 0;
  for (int i = 0; i < 3; ++i) {
    schemas::FarmAttempt attempt = testing::make_attempt(i, schemas::AttemptResult::kDone);
    attempt.started_utc = now;
    attempt.end->cpu_seconds = 9;
    now += 6 * kNanosecondsPerSecond;
    attempt.end->ended_utc = now;
    now += kNanosecondsPerSecond;
    attempts[{"render", i}].push_back(attempt);
  }
  const auto costs = measured_costs(job, attempts);
  ASSERT_TRUE(costs);
  EXPECT_EQ(costs->frames, 12);
  EXPECT_DOUBLE_EQ(costs->frame_s, 2);
  EXPECT_DOUBLE_EQ(costs->frame_cpu_s, 3);
  ASSERT_TRUE(costs->gap_s);
  EXPECT_DOUBLE_EQ(*costs->gap_s, 1);
}

TEST(CostModel, TellsFramesFromTheRestOfATask) {
  schemas::FarmJobDocument job = testing::make_small_job();
  TaskAttempts attempts;
  for (int i = 0; i < 2; ++i) {
    // 6 s, three frames.
    schemas::FarmAttempt attempt = testing::make_attempt(i, schemas::AttemptResult::kDone);
    schemas::RenderStageCosts& stages = attempt.end->rendering.emplace();
    stages.frames = i == 0 ? 2 : 3;  // one was complete before
    stages.seconds = i == 0 ? 3.0 : 4.5;
    stages.encode_s = i == 0 ? 1.0 : 2.0;
    stages.read_bytes = 1e6;
    attempts[{"render", i}].push_back(attempt);
  }
  const auto costs = measured_costs(job, attempts);
  ASSERT_TRUE(costs);
  EXPECT_DOUBLE_EQ(costs->frame_s, 1.5);
  EXPECT_DOUBLE_EQ(costs->task_s, 2.25);
  EXPECT_DOUBLE_EQ(costs->stages.encode_s, 1.6);
  EXPECT_DOUBLE_EQ(costs->frame_read_bytes, 1e6);
  const std::vector<int> nodes{1};
  EXPECT_THAT(cost_text(*costs, site(), nodes), ::testing::HasSubstr("encoding 1.6000"));
}

TEST(CostModel, ThePageHasTheCurveAndTheNumbers) {
  const std::vector<int> nodes{1, 10, 100};
  const std::string page = cost_page(costs(), site(), nodes, "Job <x>");
  EXPECT_THAT(page, ::testing::HasSubstr("<svg"));
  EXPECT_THAT(page, ::testing::HasSubstr("Job &lt;x&gt;"));
  EXPECT_THAT(page, ::testing::HasSubstr("processors"));
}

}  // namespace
}  // namespace raystage::farm
