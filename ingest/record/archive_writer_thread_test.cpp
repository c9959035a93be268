// SPDX-License-Identifier: Apache-2.0
// Tests the writer thread with archives of which some reject frames.
#include "ingest/record/archive_writer_thread.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/resource.h>

#include <csignal>
#include <new>
#include <thread>

#include "testing/test_folder.h"

namespace raystage::ingest {
namespace {

using namespace std::chrono_literals;
using ::testing::HasSubstr;

/// Cameras with archives in a temporary folder.
class Flow : public ::testing::Test {
 protected:
  static constexpr int kCameras = 3, kFrames = 40;

  Flow() {
    for (int i = 0; i < kCameras; ++i) {
      const std::string id = "c" + std::to_string(i);
      archives_.emplace_back(folder_.path() / (id + ".mkv"), folder_.path() / (id + ".journal"),
                             store::ArchiveWriter::Description{id, 64, 48, 0});
    }
  }
  void push(std::size_t camera, std::size_t bytes) { push_at(++last_time_, camera, bytes); }
  void push_record_at(Nanoseconds time, std::size_t camera) {
    auto record = std::make_shared<QueuedFrame>();
    record->time_ns = time;
    record->status = store::FrameStatus::kTorn;
    queues[camera].push(std::move(record));
  }
  void push_at(Nanoseconds time, std::size_t camera, std::size_t bytes) {
    auto frame = std::make_shared<QueuedFrame>();
    frame->time_ns = time;
    frame->jpeg.resize(bytes, std::byte{1});
    queues[camera].push(std::move(frame));
  }
  ArchiveWriterThread flow(ArchiveWriterThread::Options options) {
    std::vector<ArchiveWriterThread::Camera> cameras;
    for (std::size_t i = 0; i < kCameras; ++i) {
      cameras.push_back({queues[i], archives_[i], counters[i]});
    }
    return ArchiveWriterThread(std::move(cameras), std::move(options));
  }
  /// Makes all further writes to an archive fail.
  void refuse(std::size_t camera) { archives_[camera].close(); }

  std::vector<FrameQueue> queues = std::vector<FrameQueue>(kCameras);
  std::vector<CameraCounters> counters = std::vector<CameraCounters>(kCameras);

 private:
  testing::TestFolder folder_;
  std::vector<store::ArchiveWriter> archives_;
  Nanoseconds last_time_ = 0;
};

TEST_F(Flow, AnArchiveThatRefusesHoldsUpNoOther) {
  for (int i = 0; i < kCameras * kFrames; ++i) push(static_cast<std::size_t>(i % kCameras), 1000);
  refuse(0);
  ArchiveWriterThread writing = flow({.drain_timeout_s = 0.2, .flush_interval_s = 0});
  const auto deadline = std::chrono::steady_clock::now() + 20s;
  while (!(queues[1].empty() && queues[2].empty()) && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(1ms);
  }
  EXPECT_EQ(writing.written(1, store::FrameStatus::kStored), kFrames);
  EXPECT_EQ(writing.written(2, store::FrameStatus::kStored), kFrames);
  EXPECT_THAT(writing.write_error(),
              HasSubstr("after the archive was closed"));  // not hidden by the other cameras
  writing.drain({});
  EXPECT_EQ(counters[0].dropped, kFrames);
  EXPECT_EQ(counters[0].unrecorded, kFrames);
  EXPECT_EQ(counters[1].dropped + counters[2].dropped, 0U);
}

TEST_F(Flow, WhatNoArchiveCanHoldIsRecordedAsDroppedAndNotRetried) {
  push(0, 1000);
  push_at(Nanoseconds{1} << 60, 0, 1000);  // after 36 years
  push_at((Nanoseconds{1} << 60) + 1, 0, 1000);
  ArchiveWriterThread writing = flow({.flush_interval_s = 0});
  const auto deadline = std::chrono::steady_clock::now() + 20s;
  while (!queues[0].empty() && std::chrono::steady_clock::now() < deadline) {
    std::this_thread::sleep_for(1ms);
  }
  EXPECT_TRUE(queues[0].empty()) << "frames keep memory that other cameras need";
  writing.drain({});
  EXPECT_EQ(writing.written(0, store::FrameStatus::kStored), 1U);
  EXPECT_EQ(writing.written(0, store::FrameStatus::kDroppedDiskFull), 2U);
  EXPECT_EQ(writing.write_error(), "");
  EXPECT_EQ(counters[0].dropped, 2U);
  EXPECT_EQ(counters[0].unrecorded, 0U);
  ASSERT_EQ(counters[0].events().size(), 1U) << "one for all of them";
  EXPECT_THAT(counters[0].events()[0].what, HasSubstr("104 days"));
}

TEST_F(Flow, AtTheEndWhatNoArchiveCanHoldSpendsNoReserve) {
  push(0, 1000);
  push_at(Nanoseconds{1} << 60, 0, 1000);
  push_record_at((Nanoseconds{1} << 60) + 1, 0);
  for (int i = 0; i < kFrames; ++i) push(1, 1000);
  int released = 0;
  ArchiveWriterThread writing =
      flow({.hold = true, .release_reserved_space = [&] { ++released; }, .drain_timeout_s = 0});
  writing.drop_remaining();
  EXPECT_EQ(released, 0);
  EXPECT_EQ(writing.written(1, store::FrameStatus::kStored), kFrames);
  EXPECT_EQ(writing.written(0, store::FrameStatus::kStored), 1U);
  EXPECT_EQ(writing.written(0, store::FrameStatus::kDroppedDiskFull), 1U);
  EXPECT_EQ(writing.written(0, store::FrameStatus::kTorn), 1U);
  EXPECT_EQ(counters[0].dropped, 1U);
  EXPECT_EQ(counters[0].unrecorded, 0U);
}

TEST_F(Flow, TheSecondCopyCountsWhereTheFirstHasStopped) {
  for (FrameQueue& queue : queues) queue.set_writers(2);
  push(0, 1000);
  push_at(Nanoseconds{1} << 60, 0, 1000);
  for (FrameQueue& queue : queues) queue.stop_writer(0);
  ArchiveWriterThread second = flow({.writer = 1, .drain_timeout_s = 10, .flush_interval_s = 0});
  second.drain({});
  EXPECT_EQ(second.written(0, store::FrameStatus::kStored), 1U);
  EXPECT_EQ(counters[0].dropped, 1U);
  EXPECT_EQ(counters[0].events().size(), 1U);
}

TEST_F(Flow, AtTheEndEveryOtherIsWrittenToo) {
  for (int i = 0; i < kCameras * kFrames; ++i) push(static_cast<std::size_t>(i % kCameras), 1000);
  refuse(0);
  ArchiveWriterThread writing = flow({.hold = true, .drain_timeout_s = 0});
  writing.drain({});
  for (const std::size_t camera : {1U, 2U}) {
    EXPECT_EQ(writing.written(camera, store::FrameStatus::kStored), kFrames);
    EXPECT_EQ(counters[camera].dropped, 0U);
  }
  EXPECT_EQ(counters[0].dropped, kFrames);
}

// A limit on file size leaves space for the small frames and for every record.
TEST_F(Flow, WhatStillFitsIsWrittenBeforeItIsGivenUp) {
  push(0, 100'000);
  for (int i = 0; i < 5; ++i) push(0, 1000);
  bool released = false;
  ArchiveWriterThread writing = flow(
      {.hold = true, .release_reserved_space = [&] { released = true; }, .drain_timeout_s = 0.2});
  rlimit before{};
  ASSERT_EQ(getrlimit(RLIMIT_FSIZE, &before), 0);
  const auto old_handler = std::signal(SIGXFSZ, SIG_IGN);
  const rlimit limit{50'000, before.rlim_max};
  ASSERT_EQ(setrlimit(RLIMIT_FSIZE, &limit), 0);
  writing.drain({});
  setrlimit(RLIMIT_FSIZE, &before);
  std::signal(SIGXFSZ, old_handler);
  EXPECT_EQ(writing.written(0, store::FrameStatus::kDroppedDiskFull), 1U);
  EXPECT_EQ(writing.written(0, store::FrameStatus::kStored), 5U);
  EXPECT_EQ(counters[0].dropped, 1U);
  EXPECT_EQ(counters[0].unrecorded, 0U);
  EXPECT_FALSE(released);
}

TEST(TroubleIn, SaysWhatWentWrongWhateverItWas) {
  EXPECT_EQ(exception_message([] {}), "");
  EXPECT_THAT(exception_message([] { throw std::bad_alloc(); }), HasSubstr("bad_alloc"));
}

}  // namespace
}  // namespace raystage::ingest
