// SPDX-License-Identifier: Apache-2.0
// Tests the parts of a recorder one by one.
#include "ingest/record/camera_capture.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>
#include <sys/resource.h>
#include <unistd.h>

#include <chrono>
#include <functional>
#include <limits>
#include <memory>
#include <thread>

#include "ingest/record/clock_sync.h"
#include "ingest/record/encoder_pool.h"
#include "ingest/record/frame_queue.h"
#include "ingest/record/host_clock.h"
#include "ingest/record/jpeg_frame_check.h"
#include "ingest/record/memory_budget.h"
#include "store/jpeg/encode.h"
#include "testing/store/test_images.h"

namespace raystage::ingest {
namespace {

using Bytes = std::vector<std::byte>;

TEST(MemoryBudget, NeverGivesMoreThanItHas) {
  MemoryBudget budget(1000);
  auto a = budget.try_reserve(600);
  EXPECT_TRUE(a);
  EXPECT_FALSE(budget.try_reserve(401));
  auto b = budget.try_reserve(400);
  EXPECT_TRUE(b);
  a.shrink_to(100);
  EXPECT_EQ(budget.used(), 500U);
  auto moved = std::move(b);
  b = {};
  EXPECT_EQ(budget.used(), 500U);
  moved = {};
  EXPECT_EQ(budget.used(), 100U);
  EXPECT_EQ(budget.peak(), 1000U);
  EXPECT_FALSE(budget.try_reserve(std::size_t(-1)));
}

TEST(MemoryBudget, HoldsUnderManyThreads) {
  MemoryBudget budget(10000);
  std::vector<std::jthread> threads;
  for (int t = 0; t < 4; ++t) {
    threads.emplace_back([&budget, t] {
      for (int i = 0; i < 20000; ++i) {
        auto share = budget.try_reserve(static_cast<std::size_t>(1 + (i * 7 + t) % 5000));
        share.shrink_to(10);
      }
    });
  }
  threads.clear();
  EXPECT_EQ(budget.used(), 0U);
  EXPECT_LE(budget.peak(), 10000U);
}

TEST(MemoryBudget, WakesWhoWaitsWhenItBecomesTight) {
  using namespace std::chrono_literals;
  MemoryBudget budget(1000);
  const auto half = budget.try_reserve(500);
  EXPECT_FALSE(budget.is_under_pressure());
  budget.wait_for_pressure({}, 1ms);  // times out
  EXPECT_FALSE(budget.is_under_pressure());
  MemoryBudget::Reservation more;
  {
    const std::jthread taker([&] {
      std::this_thread::sleep_for(20ms);
      more = budget.try_reserve(1);
    });
    const auto start = std::chrono::steady_clock::now();
    budget.wait_for_pressure({}, 60000ms);
    EXPECT_LT(std::chrono::steady_clock::now() - start, 30s);
  }
  EXPECT_TRUE(budget.is_under_pressure());
}

TEST(CheckJpeg, KnowsWholeTornAndForeign) {
  const Bytes jpeg = store::encode_jpeg(testing::make(testing::Kind::kMixed, 64, 48), {});
  EXPECT_EQ(check_jpeg_frame(jpeg, 64, 48), store::FrameStatus::kStored);
  EXPECT_EQ(check_jpeg_frame(jpeg, 48, 64), store::FrameStatus::kUnreadable);
  Bytes filled = jpeg;
  filled.resize(jpeg.size() + 100);
  EXPECT_EQ(check_jpeg_frame(filled, 64, 48), store::FrameStatus::kStored);
  for (std::size_t size = 0; size < jpeg.size(); size += size < 700 ? 1 : 97) {
    EXPECT_EQ(check_jpeg_frame(std::span(jpeg).first(size), 64, 48), store::FrameStatus::kTorn)
        << size;
  }
  const Bytes text(1000, std::byte{'x'});
  EXPECT_EQ(check_jpeg_frame(text, 64, 48), store::FrameStatus::kTorn);
}

/// What captures of a camera with 64x48 pixels work with.
struct SmallPipeline {
  MemoryBudget memory, records;
  FrameQueue queue;
  EncoderPool encoders{{}, 1};
  CameraCounters counters;
  HostClock host_clock;

  explicit SmallPipeline(std::size_t bytes,
                         std::function<HostClock::Reading()> read_clock = HostClock::read_host)
      : memory(bytes), records(bytes), host_clock(std::move(read_clock)) {}

  static CameraCapture::Options options() {
    CameraCapture::Options options;
    options.width = 64;
    options.height = 48;
    return options;
  }
  CameraCapture::Pipeline parts() {
    return {queue, memory, records, encoders, counters, host_clock, [] {}};
  }
  std::unique_ptr<CameraCapture> capture(std::chrono::milliseconds wait_for_memory) {
    CameraCapture::Options with_wait = options();
    with_wait.wait_for_memory = wait_for_memory;
    return std::make_unique<CameraCapture>(with_wait, nullptr, nullptr, parts());
  }
};

TEST(CameraCapture, ACounterOrClockThatRunsWildCostsOneEventEach) {
  SmallPipeline pipeline(100'000'000);
  const auto capture = pipeline.capture(std::chrono::milliseconds(0));
  constexpr int kFrames = 20;
  const Nanoseconds start = host_steady_now();
  for (int i = 0; i < kFrames; ++i) {
    SourceFrame frame;
    frame.arrival_steady = start + i * kNanosecondsPerSecond / 50;
    frame.device_time = i * 3600 * kNanosecondsPerSecond;
    frame.sequence = static_cast<std::uint64_t>(i) * 999'999;
    frame.jpeg = store::encode_jpeg(testing::make(testing::Kind::kMixed, 64, 48), {});
    capture->take(std::move(frame));
  }
  EXPECT_EQ(pipeline.counters.skipped_by_source, 0U);
  EXPECT_EQ(pipeline.counters.dropped, 0U);
  EXPECT_EQ(pipeline.counters.corrected_timestamps, kFrames - 1U);
  EXPECT_EQ(pipeline.counters.events().size(), 2U);
  EXPECT_EQ(pipeline.queue.size(), static_cast<std::size_t>(kFrames));
}

FrameQueue::Frame queued(Nanoseconds time, QueuedFrame::Stage stage) {
  auto frame = std::make_shared<QueuedFrame>();
  frame->time_ns = time;
  frame->stage = stage;
  return frame;
}

/// Removes and returns the first frame if it is ready; null otherwise.
FrameQueue::Frame written(FrameQueue& queue) {
  const auto frames = queue.start_writing(1);
  queue.finish_writing(frames.size());
  return frames.empty() ? nullptr : frames.front();
}

TEST(FrameQueue, WaitsForTheFrontAndKeepsTheOrder) {
  FrameQueue queue;
  queue.push(queued(1, QueuedFrame::Stage::kToEncode));
  queue.push(queued(2, QueuedFrame::Stage::kToEncode));
  queue.push(queued(3, QueuedFrame::Stage::kReady));
  const auto first = queue.start_encoding(), second = queue.start_encoding();
  EXPECT_EQ(queue.start_encoding(), nullptr);
  queue.finish_encoding(second, Bytes(5));
  EXPECT_EQ(written(queue), nullptr);
  queue.finish_encoding(first, std::nullopt);
  EXPECT_EQ(written(queue)->status, store::FrameStatus::kDroppedEncoder);
  EXPECT_EQ(queue.encoder_failures(), 1U);
  EXPECT_EQ(written(queue)->time_ns, 2);
  EXPECT_EQ(written(queue)->time_ns, 3);
  EXPECT_TRUE(queue.empty());
}

TEST(FrameQueue, KeepsWhatTheWriterCouldNotWrite) {
  FrameQueue queue;
  for (Nanoseconds time = 1; time <= 5; ++time) {
    queue.push(queued(time, QueuedFrame::Stage::kReady));
  }
  EXPECT_EQ(queue.start_writing(4).size(), 4U);
  queue.finish_writing(1);
  const auto again = queue.start_writing(100);
  ASSERT_EQ(again.size(), 4U);
  EXPECT_EQ(again.front()->time_ns, 2);
  queue.finish_writing(4);
  EXPECT_TRUE(queue.empty());
}

TEST(FrameQueue, GivesUpOnlyWhatNoThreadHolds) {
  FrameQueue queue;
  queue.push(queued(1, QueuedFrame::Stage::kReady));  // the writer holds it
  queue.push(queued(2, QueuedFrame::Stage::kToEncode));
  queue.push(queued(3, QueuedFrame::Stage::kReady));
  queue.push(queued(4, QueuedFrame::Stage::kToEncode));
  EXPECT_EQ(queue.start_writing(5).size(), 1U);
  const auto encoding = queue.start_encoding();
  EXPECT_EQ(encoding->time_ns, 2);
  EXPECT_TRUE(queue.drop_one(true, store::FrameStatus::kDroppedRamFull));   // 3
  EXPECT_TRUE(queue.drop_one(false, store::FrameStatus::kDroppedRamFull));  // 4
  EXPECT_FALSE(queue.drop_one(true, store::FrameStatus::kDroppedRamFull));
  EXPECT_FALSE(queue.drop_one(false, store::FrameStatus::kDroppedRamFull));
  EXPECT_EQ(queue.start_encoding(), nullptr);  // frame 4 was dropped
  queue.finish_encoding(encoding, Bytes(5));
  queue.finish_writing(0);
  std::vector<store::FrameStatus> statuses;
  while (const auto front = written(queue)) statuses.push_back(front->status);
  EXPECT_EQ(statuses, (std::vector{store::FrameStatus::kStored, store::FrameStatus::kStored,
                                   store::FrameStatus::kDroppedRamFull,
                                   store::FrameStatus::kDroppedRamFull}));
}

TEST(FrameQueue, CallsNoEncoderForWhatWasGivenUp) {
  FrameQueue queue;
  EXPECT_FALSE(queue.needs_encoder());
  queue.push(queued(1, QueuedFrame::Stage::kReady));
  EXPECT_FALSE(queue.needs_encoder());
  int called = 0;
  for (Nanoseconds time = 2; time < 1000; ++time) {  // no encoder starts
    queue.push(queued(time, QueuedFrame::Stage::kToEncode));
    if (time > 3) {
      EXPECT_TRUE(queue.drop_one(true, store::FrameStatus::kDroppedRamFull));
    }
    called += queue.needs_encoder() ? 1 : 0;
  }
  EXPECT_EQ(called, 2);
  EXPECT_NE(queue.start_encoding(), nullptr);
  queue.push(queued(1000, QueuedFrame::Stage::kToEncode));
  EXPECT_TRUE(queue.needs_encoder());
  EXPECT_NE(queue.start_encoding(), nullptr);
  EXPECT_NE(queue.start_encoding(), nullptr);
  EXPECT_EQ(queue.start_encoding(), nullptr);
}

TEST(CameraCapture, ThisComputersClockMayBeSet) {
  constexpr Nanoseconds kDay = 24 * 3600 * kNanosecondsPerSecond, kStart = 20'000 * kDay;
  for (const bool has_device_clock : {false, true}) {
    for (const Nanoseconds step : {-40 * kDay, 10'000 * kDay}) {  // found without a battery
      HostClock::Reading now{kStart, kDay};
      SmallPipeline pipeline(100'000'000, [&] { return now; });
      CameraCapture::Options options = SmallPipeline::options();
      options.epoch_utc = options.start_utc = kStart;
      CameraCapture capture(options, nullptr, nullptr, pipeline.parts());
      for (int i = 0; i < 20; ++i) {
        now.utc += kNanosecondsPerSecond + (i == 10 ? step : 0);
        now.steady += kNanosecondsPerSecond;
        SourceFrame frame;
        frame.jpeg = store::encode_jpeg(testing::make(testing::Kind::kMixed, 64, 48), {});
        frame.arrival_steady = now.steady;
        if (has_device_clock) frame.device_time = 5 * kDay + i * kNanosecondsPerSecond;
        capture.take(std::move(frame));
      }
      EXPECT_EQ(pipeline.counters.corrected_timestamps, 0U);
      ASSERT_EQ(pipeline.counters.events().size(), 1U);
      EXPECT_NE(pipeline.counters.events()[0].what.find("clock was set"), std::string::npos);
      for (Nanoseconds i = 1; i <= 20; ++i) {
        EXPECT_EQ(written(pipeline.queue)->time_ns, i * kNanosecondsPerSecond);
      }
    }
  }
}

TEST(CameraCapture, WaitsForRoomWhereTheSourceWaitsToo) {
  using namespace std::chrono_literals;
  SmallPipeline pipeline(100000);
  const auto picture = [] {
    SourceFrame frame;
    frame.jpeg = store::encode_jpeg(testing::make(testing::Kind::kMixed, 64, 48), {});
    frame.arrival_steady = host_steady_now();
    return frame;
  };
  MemoryBudget::Reservation others = pipeline.memory.try_reserve(99900);
  {
    const std::jthread writer([&] {
      std::this_thread::sleep_for(20ms);
      others.shrink_to(0);
    });
    pipeline.capture(60s)->take(picture());
  }
  EXPECT_EQ(pipeline.counters.dropped, 0U);

  others = pipeline.memory.try_reserve(100000 - pipeline.memory.used());
  const auto patient = pipeline.capture(50ms);
  const auto start = std::chrono::steady_clock::now();
  patient->take(picture());
  EXPECT_EQ(pipeline.counters.dropped, 1U);
  EXPECT_GE(std::chrono::steady_clock::now() - start, 50ms);
  const auto again = std::chrono::steady_clock::now();
  for (int i = 0; i < 100; ++i) patient->take(picture());  // only the first one waits
  EXPECT_EQ(pipeline.counters.dropped, 101U);
  EXPECT_LT(std::chrono::steady_clock::now() - again, 4s);
}

// TBB ends the process if it cannot start a thread.
TEST(EncoderPoolDeathTest, NeedsNoThreadWhenMemoryIsShort) {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
  GTEST_SKIP() << "sanitizers take memory of their own";
#endif
  ::testing::FLAGS_gtest_death_test_style = "threadsafe";
  const auto encode_without_memory = [] {
    constexpr int kFrames = 20;
    FrameQueue queue;
    EncoderPool encoders({}, 2);
    for (int i = 0; i < kFrames; ++i) {
      auto frame = queued(i + 1, QueuedFrame::Stage::kToEncode);
      frame->raw.width = frame->raw.height = 8;
      frame->raw.format = store::PixelFormat::kGray;
      auto pixels = std::make_shared<Bytes>(64);
      frame->raw.planes[0] = {pixels->data(), 8};
      frame->raw.owner = pixels;
      queue.push(std::move(frame));
    }
    rlimit before{};
    getrlimit(RLIMIT_DATA, &before);
    const rlimit none{1, before.rlim_max};
    setrlimit(RLIMIT_DATA, &none);
    for (int i = 0; i < kFrames; ++i) encoders.encode_next(queue);
    encoders.wait();
    setrlimit(RLIMIT_DATA, &before);
    int ready = 0;
    while (written(queue) != nullptr) ++ready;
    _exit(ready == kFrames ? 0 : 1);
  };
  EXPECT_EXIT(encode_without_memory(), ::testing::ExitedWithCode(0), "");
}

TEST(EncoderPool, WhatCannotBeEncodedIsMissing) {
  FrameQueue queue;
  EncoderPool encoders({}, 2);
  for (int i = 0; i < 20; ++i) {
    auto frame = queued(i + 1, QueuedFrame::Stage::kToEncode);
    frame->raw.width = i % 2 == 0 ? 70000 : 8;  // wider than a JPEG can be
    frame->raw.height = 8;
    frame->raw.format = store::PixelFormat::kGray;
    auto pixels = std::make_shared<Bytes>(64);
    frame->raw.planes[0] = {pixels->data(), i % 2 == 0 ? std::size_t{70000} : 8};
    frame->raw.owner = pixels;
    queue.push(std::move(frame));
    encoders.encode_next(queue);
  }
  encoders.wait();
  EXPECT_EQ(queue.encoder_failures(), 10U);
  for (int i = 0; i < 20; ++i) {
    const auto frame = written(queue);
    ASSERT_NE(frame, nullptr);
    EXPECT_EQ(frame->status,
              i % 2 == 0 ? store::FrameStatus::kDroppedEncoder : store::FrameStatus::kStored);
  }
}

TEST(ClockState, ReadsChronysAnswer) {
  const auto clock = parse_chrony_tracking(
      "C0A80101,192.168.1.1,3,1763710000.123,-0.000012345,0.000001,0.00001,-12.3,0.001,0.05,0.0004,"
      "0.0003,64.2,Normal\n");
  EXPECT_EQ(clock.source, "chrony");
  EXPECT_DOUBLE_EQ(*clock.offset_s, -0.000012345);
  EXPECT_DOUBLE_EQ(*clock.max_error_s, 0.000012345 + 0.0002 + 0.0003);
  for (const char* answer :
       {"", "506 Cannot talk to daemon\n",
        "00000000,,0,0.0,0.0,0.0,0.0,0.0,0.0,0.0,1.0,1.0,0.0,Not synchronised"}) {
    EXPECT_EQ(parse_chrony_tracking(answer).source, "unknown") << answer;
  }
  const auto here = query_clock_sync();
  EXPECT_TRUE(here.source == "unknown" || here.max_error_s || here.source == "ptp");
}

TEST(ClockState, ReadsPmcsAnswer) {
  const auto offset = parse_pmc_offset(
      "sending: GET CURRENT_DATA_SET\n\t507c6f.fffe.0b5a4d-0 seq 0 RESPONSE MANAGEMENT "
      "CURRENT_DATA_SET \n\t\tstepsRemoved     1\n\t\toffsetFromMaster -1234.5\n"
      "\t\tmeanPathDelay    5678.0\n");
  ASSERT_TRUE(offset);
  EXPECT_DOUBLE_EQ(*offset, -1234.5e-9);
  for (const char* answer :
       {"", "sending: GET CURRENT_DATA_SET\n", "offsetFromMaster", "offsetFromMaster \n",
        "offsetFromMaster nan\n", "offsetFromMaster 12x\n", "offsetFromMasterClock 3\n"}) {
    EXPECT_FALSE(parse_pmc_offset(answer)) << answer;
  }
}

}  // namespace
}  // namespace raystage::ingest
