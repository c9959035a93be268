// SPDX-License-Identifier: Apache-2.0
#include "testing/ingest/scripted_source.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <thread>

#include "base/error.h"
#include "testing/ingest/test_pictures.h"

namespace raystage::testing {
namespace {

using namespace std::chrono_literals;
using Outcome = ingest::FrameSource::Outcome;
using Clock = std::chrono::steady_clock;

SourceScript script(double fps) {
  SourceScript script;
  script.fps = fps;
  for (int shade : {50, 150}) {
    ingest::SourceFrame frame;
    frame.jpeg = test_jpeg(32, 24, shade);
    script.frames.push_back(frame);
  }
  return script;
}

/// Returns all frames until another outcome, which `last` receives.
std::vector<ingest::SourceFrame> all_of(ingest::FrameSource& source, Outcome& last) {
  std::vector<ingest::SourceFrame> frames;
  ingest::SourceFrame frame;
  while ((last = source.next(frame, 2000ms)) == Outcome::kFrame) frames.push_back(frame);
  return frames;
}

TEST(MemorySource, DeliversItsFramesInTurnUntilTheEnd) {
  SourceScript three = script(0);
  three.count = 3;
  const std::vector<ingest::SourceFrame> given = three.frames;
  const auto source = make_scripted_source(three);
  EXPECT_EQ(source->description().width, 32);
  EXPECT_EQ(source->description().height, 24);
  EXPECT_TRUE(source->description().delivers_jpeg);
  Outcome last{};
  const auto frames = all_of(*source, last);
  EXPECT_EQ(last, Outcome::kEnded);
  ASSERT_EQ(frames.size(), 3U);
  for (std::size_t i = 0; i < 3; ++i) {
    EXPECT_EQ(frames[i].jpeg, given[i % 2].jpeg);
    EXPECT_EQ(frames[i].sequence, i);
    EXPECT_FALSE(frames[i].torn);
    EXPECT_NEAR(static_cast<double>(frames[i].arrival_steady),
                static_cast<double>(ingest::host_steady_now()), 5e9);
  }
}

TEST(MemorySource, KeepsItsRate) {
  SourceScript paced = script(100);
  paced.count = 21;
  paced.clock_ppm = 1000;
  const auto source = make_scripted_source(paced);
  const auto start = Clock::now();
  Outcome last{};
  const auto frames = all_of(*source, last);
  ASSERT_EQ(frames.size(), 21U);
  EXPECT_GE(Clock::now() - start, 200ms);
  EXPECT_EQ(frames[20].device_time, 200'200'000);  // a device clock that runs fast by 0.1 %
}

TEST(MemorySource, PatienceEndsAndInterruptsAreHeard) {
  const auto source = make_scripted_source(script(0.5));
  ingest::SourceFrame frame;
  ASSERT_EQ(source->next(frame, 100ms), Outcome::kFrame);
  auto start = Clock::now();
  EXPECT_EQ(source->next(frame, 20ms), Outcome::kNoData);
  EXPECT_GE(Clock::now() - start, 20ms);
  start = Clock::now();
  std::thread other([&] {
    std::this_thread::sleep_for(20ms);
    source->interrupt();
  });
  EXPECT_EQ(source->next(frame, 1500ms), Outcome::kNoData);
  EXPECT_LT(Clock::now() - start, 1000ms);
  other.join();
}

TEST(MemorySource, MisbehavesAsItIsTold) {
  SourceScript bad = script(0);
  ingest::SourceFrame large;
  large.jpeg = test_jpeg(64, 48, 90);
  bad.events.push_back({1, SourceScript::Tear{}});
  bad.events.push_back({3, SourceScript::Gap{5}});
  bad.events.push_back({9, SourceScript::Change{{large}}});
  bad.events.push_back({11, SourceScript::Death{"the cable was pulled"}});
  const auto source = make_scripted_source(bad);
  Outcome last{};
  const auto frames = all_of(*source, last);
  std::vector<std::uint64_t> numbers;
  for (const ingest::SourceFrame& frame : frames) numbers.push_back(frame.sequence.value());
  EXPECT_THAT(numbers, ::testing::ElementsAre(0, 1, 2, 8, 9, 10));
  EXPECT_TRUE(frames[1].torn);
  EXPECT_EQ(frames[1].jpeg.size(), bad.frames[1].jpeg.size() / 2);
  EXPECT_FALSE(frames[2].torn);
  EXPECT_EQ(frames[4].jpeg, large.jpeg);
  EXPECT_EQ(last, Outcome::kLost);
  EXPECT_EQ(source->loss_reason(), "the cable was pulled");
  ingest::SourceFrame frame;
  EXPECT_EQ(source->next(frame, 0ms), Outcome::kLost);
}

TEST(MemorySource, AStallLosesWhatIsExposedMeanwhile) {
  SourceScript stalls = script(100);
  stalls.count = 20;
  stalls.events.push_back({5, SourceScript::Stall{0.1}});
  const auto source = make_scripted_source(stalls);
  Outcome last{};
  const auto frames = all_of(*source, last);
  ASSERT_EQ(frames.size(), 10U);
  EXPECT_EQ(frames[4].sequence, 4U);
  EXPECT_EQ(frames[5].sequence, 15U);
  EXPECT_GE(frames[5].arrival_steady - frames[4].arrival_steady, 80'000'000);
}

TEST(MemorySource, ALateReaderFindsWhatTheBuffersHold) {
  SourceScript few = script(200);
  few.count = 40;
  few.buffers = 3;
  const auto source = make_scripted_source(few);
  ingest::SourceFrame frame;
  ASSERT_EQ(source->next(frame, 100ms), Outcome::kFrame);
  std::this_thread::sleep_for(250ms);  // all others are exposed meanwhile
  Outcome last{};
  const auto frames = all_of(*source, last);
  ASSERT_EQ(frames.size(), 3U);
  EXPECT_EQ(frames[0].sequence, 1U);
  EXPECT_EQ(frames[2].sequence, 3U);
  EXPECT_EQ(last, Outcome::kEnded);
}

TEST(MemorySource, ScriptsWithoutPicturesAreRefused) {
  EXPECT_THROW(make_scripted_source({}), Error);
  SourceScript empty = script(0);
  empty.frames.emplace_back();
  EXPECT_THROW(make_scripted_source(empty), Error);
  SourceScript rate = script(-1);
  EXPECT_THROW(make_scripted_source(rate), Error);
}

}  // namespace
}  // namespace raystage::testing
