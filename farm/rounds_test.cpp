// SPDX-License-Identifier: Apache-2.0
#include "farm/rounds.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "testing/farm/test_job.h"

namespace raystage::farm {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using testing::make_attempt;

class Rounds : public ::testing::Test {
 protected:
  void happened(const schemas::FarmAttempt& attempt) {
    attempts_[{attempt.stage, attempt.index}].push_back(attempt);
  }
  RoundDecision verdict(std::vector<int> missing, int round = 1, int first_round = 1) {
    missing_ = std::move(missing);
    return decide_next_round({job_, attempts_, missing_, excluded_, round, first_round});
  }

  const schemas::FarmJobDocument job_ = testing::make_small_job();
  TaskAttempts attempts_;
  std::vector<int> missing_;
  std::vector<std::string> excluded_;
};

TEST_F(Rounds, EndWhereNothingIsMissing) {
  const RoundDecision end = verdict({});
  EXPECT_FALSE(end.next);
  EXPECT_EQ(end.end.state, schemas::FarmEnd::State::kDone);
  EXPECT_EQ(end.end.frames, 12);
}

TEST_F(Rounds, TryAgainOnlyChunksWithMissingFrames) {
  happened(make_attempt(1, schemas::AttemptResult::kFailed));
  excluded_ = {"n3"};
  happened(make_attempt(0, schemas::AttemptResult::kDone, "n2"));
  const RoundDecision next = verdict({5, 8});
  ASSERT_TRUE(next.next);
  EXPECT_EQ(next.next->round, 2);
  EXPECT_THAT(next.next->render, ElementsAre(1, 2));
  EXPECT_THAT(next.next->exclude, ElementsAre("n3"));
  EXPECT_TRUE(next.next->prepare.empty());
}

TEST_F(Rounds, GiveUpAfterTheAttemptsOfTheJob) {
  for (int i = 0; i < job_.attempts; ++i)
    happened(make_attempt(1, schemas::AttemptResult::kFailed));
  const RoundDecision over = verdict({4, 5});
  EXPECT_FALSE(over.next);
  EXPECT_EQ(over.end.state, schemas::FarmEnd::State::kFailed);
  EXPECT_EQ(over.end.missing_frames, "4-5");
  EXPECT_THAT(over.end.reason, HasSubstr("frames 4-5: it broke"));
  EXPECT_TRUE(verdict({4, 5}, 5, 5).next) << "a retry by hand begins to count anew";
}

TEST_F(Rounds, NeverTryBadInputAgain) {
  happened(make_attempt(3, schemas::AttemptResult::kBadInput));
  EXPECT_FALSE(verdict({10}).next);
}

TEST_F(Rounds, RaiseMemoryOnce) {
  happened(make_attempt(0, schemas::AttemptResult::kOutOfMemory));
  ASSERT_TRUE(verdict({1}).next);
  EXPECT_EQ(verdict({1}).next->memory_factor, 1.5);
  happened(make_attempt(0, schemas::AttemptResult::kOutOfMemory));
  EXPECT_FALSE(verdict({1}, 2).next);
}

TEST_F(Rounds, PrepareAgainOnceWhatRanOutOfMemory) {
  schemas::FarmAttempt prepare = make_attempt(0, schemas::AttemptResult::kOutOfMemory);
  prepare.stage = "prepare";
  happened(prepare);
  happened(make_attempt(0, schemas::AttemptResult::kDeclined));
  happened(make_attempt(1, schemas::AttemptResult::kDeclined));
  const RoundDecision next = verdict({1, 2, 3, 4});
  ASSERT_TRUE(next.next);
  EXPECT_THAT(next.next->prepare, ElementsAre(0)) << "one task for both chunks";
  EXPECT_EQ(next.next->memory_factor, 1.5);
  happened(prepare);
  EXPECT_TRUE(verdict({1}, 2).next->prepare.empty()) << "the chunk derives it itself";
}

TEST_F(Rounds, DoubleTheTimeOfWhatWasStopped) {
  happened(make_attempt(0, schemas::AttemptResult::kStopped));
  ASSERT_TRUE(verdict({1}).next);
  EXPECT_EQ(verdict({1}).next->time_factor, 2);
}

TEST_F(Rounds, LostNodesCostATaskNoAttempt) {
  for (int i = 0; i < 5; ++i) {
    schemas::FarmAttempt lost =
        make_attempt(0, schemas::AttemptResult::kDone, "n" + std::to_string(i));
    lost.end.reset();
    happened(lost);
    schemas::FarmAttempt fault = make_attempt(0, schemas::AttemptResult::kFailed, "n9");
    fault.end->node_fault = i % 2 == 0;
    fault.end->result =
        i % 2 == 0 ? schemas::AttemptResult::kFailed : schemas::AttemptResult::kDeclined;
    if (i < 4) happened(fault);
  }
  EXPECT_TRUE(verdict({1}).next);
}

TEST_F(Rounds, BlameNoNodesWhereAllAreAtFault) {
  happened(make_attempt(0, schemas::AttemptResult::kFailed, "n1"));
  happened(make_attempt(1, schemas::AttemptResult::kFailed, "n2"));
  excluded_ = {"n1", "n2"};
  const RoundDecision over = verdict({1, 4});
  EXPECT_FALSE(over.next) << "it would wait for ever for a node";
  EXPECT_THAT(over.end.reason, HasSubstr("2 nodes failed"));
}

TEST_F(Rounds, LargeFarmsMayLoseMoreNodes) {
  for (int i = 0; i < 40; ++i) {
    happened(make_attempt(1 + i % 3, schemas::AttemptResult::kDone, "n" + std::to_string(i)));
  }
  excluded_ = {"n1", "n2", "n3", "n4", "n5", "n6"};
  EXPECT_TRUE(verdict({1}).next) << "6 of 40";
  for (int i = 7; i < 12; ++i) excluded_.push_back("n" + std::to_string(i));
  EXPECT_FALSE(verdict({1}).next) << "11 of 40";
}

}  // namespace
}  // namespace raystage::farm
