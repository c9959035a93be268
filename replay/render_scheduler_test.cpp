// SPDX-License-Identifier: Apache-2.0
#include "replay/render_scheduler.h"

#include <gtest/gtest.h>

#include <atomic>
#include <condition_variable>
#include <future>
#include <mutex>
#include <string>
#include <thread>

#include "base/cancellation.h"
#include "base/parallel.h"

namespace raystage::replay {
namespace {

/// Holds the first lane until it is opened, so that jobs wait.
class Gate {
 public:
  RenderScheduler::Job job() {
    return [this](const std::stop_token&) {
      entered_.set_value();
      opened_.get_future().wait();
    };
  }
  void wait_until_entered() { entered_.get_future().wait(); }
  void open() { opened_.set_value(); }

 private:
  std::promise<void> entered_, opened_;
};

/// Records the order of jobs.
class Log {
 public:
  RenderScheduler::Job job(const std::string& name) {
    return [this, name](const std::stop_token&) {
      const std::scoped_lock lock(mutex_);
      text_ += name;
      changed_.notify_all();
    };
  }
  std::string wait_for(std::size_t length) {
    std::unique_lock lock(mutex_);
    changed_.wait_for(lock, std::chrono::seconds(20), [&] { return text_.size() >= length; });
    return text_;
  }

 private:
  std::mutex mutex_;
  std::condition_variable changed_;
  std::string text_;
};

TEST(RenderScheduler, TheNewestOfAKindReplacesThoseThatWait) {
  Log log;
  Gate gate;
  RenderScheduler scheduler(2);
  scheduler.submit(1, JobKind::kMotion, gate.job());
  gate.wait_until_entered();
  int dropped = 0;
  scheduler.submit(2, JobKind::kMotion, log.job("a"), [&] { ++dropped; });
  scheduler.submit(2, JobKind::kMotion, log.job("b"), [&] { dropped += 100; });
  scheduler.submit(2, JobKind::kFocus, log.job("f"));
  scheduler.submit(2, JobKind::kProbe, log.job("p"));
  EXPECT_EQ(dropped, 1);
  gate.open();
  EXPECT_EQ(log.wait_for(3), "fpb");
  EXPECT_EQ(dropped, 1);
}

TEST(RenderScheduler, ClientsTakeTurns) {
  Log log;
  Gate gate;
  RenderScheduler scheduler(2);
  scheduler.submit(1, JobKind::kMotion, gate.job());
  gate.wait_until_entered();
  for (const JobKind kind : {JobKind::kFocus, JobKind::kMotion, JobKind::kFile}) {
    scheduler.submit(2, kind, log.job("2"));
    scheduler.submit(3, kind, log.job("3"));
  }
  gate.open();
  EXPECT_EQ(log.wait_for(6), "232323");
}

// Computing ranges of motion takes seconds. Other jobs of the lane end it.
TEST(RenderScheduler, RangesGiveWayToOtherClients) {
  Log log;
  RenderScheduler scheduler(2);
  std::promise<void> started, ended;
  scheduler.submit(1, JobKind::kRanges, [&](const std::stop_token& stop) {
    started.set_value();
    while (!stop.stop_requested()) std::this_thread::yield();
    ended.set_value();
  });
  started.get_future().wait();
  scheduler.submit(2, JobKind::kSnapshot, log.job("s"));
  ended.get_future().wait();
  EXPECT_EQ(log.wait_for(1), "s");
}

TEST(RenderScheduler, FilesAreAllWrittenInTurn) {
  Log log;
  Gate gate;
  RenderScheduler scheduler(2);
  scheduler.submit(1, JobKind::kMotion, gate.job());
  gate.wait_until_entered();
  int dropped = 0;
  const auto count = [&] { ++dropped; };
  scheduler.submit(2, JobKind::kFile, log.job("1"), count);
  scheduler.submit(2, JobKind::kMotion, log.job("m"), count);
  scheduler.submit(2, JobKind::kFile, log.job("2"), count);
  scheduler.submit(2, JobKind::kDocument, log.job("d"), count);
  EXPECT_EQ(dropped, 1);  // the motion
  scheduler.submit(2, JobKind::kFile, log.job("3"), count);
  gate.open();
  EXPECT_EQ(log.wait_for(4), "d123");
  EXPECT_EQ(dropped, 1);
}

TEST(RenderScheduler, SnapshotsAreAllWrittenBesideWhatMoves) {
  RenderScheduler scheduler(2);
  Log log;
  std::promise<void> started, finish;
  scheduler.submit(1, JobKind::kSnapshot, [&](const std::stop_token& stop) {
    started.set_value();
    finish.get_future().wait();
    EXPECT_FALSE(stop.stop_requested());
  });
  started.get_future().wait();
  scheduler.submit(1, JobKind::kSnapshot, log.job("s"));
  scheduler.submit(1, JobKind::kDocument, log.job("d"));
  scheduler.submit(1, JobKind::kMotion, log.job("m"));
  EXPECT_EQ(log.wait_for(2), "dm");
  scheduler.submit(1, JobKind::kRefinement, log.job("r"));
  finish.set_value();
  EXPECT_EQ(log.wait_for(4), "dmsr");
}

TEST(RenderScheduler, WaitingFilesAreBounded) {
  Log log;
  Gate gate;
  RenderScheduler scheduler(2);
  scheduler.submit(1, JobKind::kMotion, gate.job());
  gate.wait_until_entered();
  int dropped = 0;
  for (int i = 0; i < 20; ++i)
    scheduler.submit(2, JobKind::kFile, log.job("f"), [&] { ++dropped; });
  EXPECT_EQ(dropped, 4);
  gate.open();
  EXPECT_EQ(log.wait_for(16), std::string(16, 'f'));
}

/// Waits in a parallel loop until it is cancelled.
void wait_until_cancelled(const std::stop_token& stop) {
  const CancellationScope scope(stop);
  parallel_for(0, 2, [](int, const ParallelLoop& loop) {
    while (!loop.failed()) std::this_thread::yield();
  });
}

TEST(RenderScheduler, MotionAndNewerRefinementsEndARefinement) {
  RenderScheduler scheduler(2);
  for (const JobKind kind : {JobKind::kMotion, JobKind::kRefinement, JobKind::kDocument}) {
    std::promise<void> started, ended, next;
    scheduler.submit(1, JobKind::kRefinement, [&](const std::stop_token& stop) {
      started.set_value();
      try {
        wait_until_cancelled(stop);
      } catch (const Cancelled&) {
        ended.set_value();
        throw;
      }
    });
    started.get_future().wait();
    scheduler.submit(1, kind, [&](const std::stop_token&) { next.set_value(); });
    ended.get_future().wait();
    next.get_future().wait();
  }
}

TEST(RenderScheduler, MotionOfOneClientLeavesTheRefinementOfAnotherAlone) {
  RenderScheduler scheduler(2);
  std::promise<void> started, finish, moved;
  std::promise<bool> was_stopped;
  scheduler.submit(1, JobKind::kRefinement, [&](const std::stop_token& stop) {
    started.set_value();
    finish.get_future().wait();
    was_stopped.set_value(stop.stop_requested());
  });
  started.get_future().wait();
  scheduler.submit(2, JobKind::kMotion, [&](const std::stop_token&) { moved.set_value(); });
  moved.get_future().wait();
  finish.set_value();
  EXPECT_FALSE(was_stopped.get_future().get());
}

TEST(RenderScheduler, RemovedClientsAreForgotten) {
  Log log;
  Gate gate;
  RenderScheduler scheduler(2);
  scheduler.submit(1, JobKind::kMotion, gate.job());
  gate.wait_until_entered();
  scheduler.submit(1, JobKind::kProbe, log.job("x"));
  scheduler.submit(2, JobKind::kMotion, log.job("y"));
  scheduler.submit(3, JobKind::kMotion, log.job("z"));
  scheduler.remove(1);
  scheduler.remove(2);
  gate.open();
  EXPECT_EQ(log.wait_for(1), "z");
}

TEST(RenderScheduler, EndsWhateverRuns) {
  std::promise<void> started;
  bool has_run = false;
  RenderScheduler scheduler(2);
  scheduler.submit(1, JobKind::kRefinement, [&](const std::stop_token& stop) {
    started.set_value();
    wait_until_cancelled(stop);
  });
  started.get_future().wait();
  scheduler.end();
  scheduler.submit(1, JobKind::kMotion, [&](const std::stop_token&) { has_run = true; });
  scheduler.end();
  EXPECT_FALSE(has_run);
}

}  // namespace
}  // namespace raystage::replay
