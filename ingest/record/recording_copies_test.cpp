// SPDX-License-Identifier: Apache-2.0
// Tests recordings with a mirror: both copies are the same, and either goes on without the other.
#include "ingest/record/recording_copies.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <fstream>
#include <random>
#include <thread>

#include "base/error.h"
#include "ingest/record/open_cameras.h"
#include "ingest/record/record_setup.h"
#include "store/fixity/repair.h"
#include "store/fixity/verify.h"
#include "store/jpeg/encode.h"
#include "testing/ingest/scripted_source.h"
#include "testing/store/archive_test_data.h"
#include "testing/store/test_images.h"
#include "testing/test_folder.h"

namespace raystage::ingest {
namespace {

namespace fs = std::filesystem;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr int kMirroredCameras = 3;

testing::SourceScript mirrored_script(double fps, std::uint64_t count) {
  testing::SourceScript script;
  for (std::uint32_t seed = 1; seed <= 3; ++seed) {
    SourceFrame frame;
    frame.jpeg = store::encode_jpeg(testing::make(testing::Kind::kMixed, 64, 48, seed), {});
    script.frames.push_back(std::move(frame));
  }
  script.fps = fps;
  script.count = count;
  return script;
}

std::vector<RecorderCamera> mirrored_cameras(const testing::SourceScript& script) {
  schemas::RecordConfig config;
  for (int i = 0; i < kMirroredCameras; ++i) {
    config.cameras.push_back({"c" + std::to_string(i), schemas::RecordConfig::SimulatedSource{}});
  }
  return open_cameras(config, [&](const schemas::RecordConfig::Camera&) {
    return testing::make_scripted_source(script);
  });
}

std::map<std::string, std::vector<std::byte>> files_below(const fs::path& folder) {
  std::map<std::string, std::vector<std::byte>> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (!entry.is_regular_file()) continue;
    files.emplace(entry.path().lexically_relative(folder).string(),
                  testing::bytes_of(entry.path()));
  }
  return files;
}

/// A take and its mirror.
struct BothTakes {
  BothTakes(const fs::path& take_folder, const fs::path& mirror_folder,
            const std::vector<RecorderCamera>& cameras) {
    schemas::RecordConfig config;
    config.name = "test";
    std::vector<std::string> ids;
    for (const RecorderCamera& camera : cameras) ids.push_back(camera.id);
    auto document = make_take_document(config, cameras, "node", host_utc_now(), "test");
    const auto rig = make_recording_rig(config, {}, cameras);
    const bool mirror_exists = fs::exists(mirror_folder / "take.json");
    if (fs::exists(take_folder / "take.json")) {
      takes.push_back(RecordingTake::resume(take_folder, ids, "node",
                                            mirror_exists ? mirror_folder : fs::path()));
      document = takes[0].document();
    } else {
      takes.push_back(RecordingTake::create(take_folder, document, rig, "node"));
    }
    takes.push_back(mirror_exists ? RecordingTake::resume(mirror_folder, ids, "node", take_folder)
                                  : RecordingTake::create(mirror_folder, document, rig, "node"));
    takes[1].complete_from(takes[0]);
    takes[0].complete_from(takes[1]);
  }
  std::vector<RecordingTake> takes;
};

class MirroredRecording : public ::testing::Test {
 protected:
  /// Records `count` frames of each camera after `prepare`.
  schemas::RecordingDocument::Session record(std::uint64_t count, double fps,
                                             const std::function<void(BothTakes&)>& prepare = {}) {
    auto cameras = mirrored_cameras(mirrored_script(fps, count));
    BothTakes both(take, mirror, cameras);
    if (prepare) prepare(both);
    Recorder recorder(options, std::move(cameras), both.takes[0], "test", &both.takes[1]);
    return recorder.run({}, [&](const RecorderStatus& status) { states.push_back(status); });
  }
  /// Makes all further writes to a copy fail.
  static std::function<void(BothTakes&)> refuse(std::size_t copy) {
    return [copy](BothTakes& both) {
      for (int i = 0; i < kMirroredCameras; ++i) {
        both.takes[copy].archive(static_cast<std::size_t>(i)).close();
      }
    };
  }
  static std::size_t stored(const fs::path& folder) {
    const store::Take opened(folder);
    std::size_t frames = 0;
    for (int i = 0; i < opened.camera_count(); ++i) frames += opened.archive(i).frames().size();
    return frames;
  }
  static RecorderOptions quick() {
    RecorderOptions quick;
    quick.start_utc = 0;
    quick.status_interval_s = 0.05;
    quick.drain_timeout_s = 0.3;
    return quick;
  }

  testing::TestFolder folder;
  fs::path take = folder.path() / "take", mirror = folder.path() / "disk" / "take";
  RecorderOptions options = quick();
  std::vector<RecorderStatus> states;
};

TEST_F(MirroredRecording, BothCopiesAreTheSame) {
  for (const bool hold : {false, true}) {
    SCOPED_TRACE(hold);
    fs::remove_all(take);
    fs::remove_all(mirror);
    options.hold = hold;
    const auto session = record(200, 500);
    ASSERT_TRUE(session.audit && session.audit->holds);
    ASSERT_EQ(session.copies.size(), 2U);
    for (const auto& copy : session.copies) EXPECT_TRUE(copy.complete) << copy.problem;
    EXPECT_EQ(stored(take), 200U * kMirroredCameras);
    EXPECT_EQ(files_below(take), files_below(mirror));
    EXPECT_TRUE(store::verify_take(take, {}).is_intact());
    EXPECT_TRUE(store::verify_take(mirror, {}).is_intact());
    EXPECT_EQ(states.back().copies.size(), 2U);
  }
}

TEST_F(MirroredRecording, EitherCopyGoesOnWithoutTheOther) {
  for (const std::size_t refusing : {1U, 0U}) {
    SCOPED_TRACE(refusing);
    fs::remove_all(take);
    fs::remove_all(mirror);
    states.clear();
    options.memory_bytes =
        300'000;  // much less than all frames, but more than come in half a second
    const auto session = record(400, 100, refuse(refusing));
    ASSERT_TRUE(session.audit);
    EXPECT_TRUE(session.audit->holds) << ::testing::PrintToString(session.audit->problems);
    const fs::path &whole = refusing == 1 ? take : mirror, &other = refusing == 1 ? mirror : take;
    EXPECT_EQ(stored(whole), 400U * kMirroredCameras);
    EXPECT_TRUE(store::verify_take(whole, {}).is_intact());
    EXPECT_TRUE(session.copies[1 - refusing].complete);
    EXPECT_FALSE(session.copies[refusing].complete);
    EXPECT_THAT(session.copies[refusing].problem, HasSubstr("after the archive was closed"));
    for (const auto& camera : session.cameras) EXPECT_THAT(camera.dropped, IsEmpty());
    EXPECT_EQ(states.back().copies[refusing].stop_reason, session.copies[refusing].problem);
    // What the stopped one has is a valid take, which is completed from the other.
    EXPECT_LT(stored(other), 400U * kMirroredCameras);
    const auto report = store::repair_take(other, {.copy = whole});
    EXPECT_FALSE(report.failed() || report.has_losses());
    EXPECT_EQ(files_below(other), files_below(whole));
  }
}

// With enough memory a refused copy is stopped only at the end.
TEST_F(MirroredRecording, ACopyThatIsIncompleteAtTheEndIsSaid) {
  const auto session = record(50, 500, refuse(1));
  EXPECT_TRUE(session.audit && session.audit->holds);
  EXPECT_TRUE(session.copies[0].complete);
  EXPECT_FALSE(session.copies[1].complete);
  EXPECT_EQ(stored(take), 50U * kMirroredCameras);
}

// The take has no frame, its mirror those of all cameras but the first: it is kept.
TEST_F(MirroredRecording, WithoutAWholeCopyTheOneWithMostFramesIsKept) {
  const auto session = record(50, 500, [](BothTakes& both) {
    refuse(0)(both);
    both.takes[1].archive(0).close();
  });
  ASSERT_TRUE(session.audit);
  EXPECT_FALSE(session.audit->holds) << "the first camera's archive accepts no records either";
  ASSERT_EQ(session.copies.size(), 2U);
  EXPECT_FALSE(session.copies[0].complete);
  EXPECT_TRUE(session.copies[1].complete);
  EXPECT_EQ(stored(take), 0U);
  EXPECT_EQ(stored(mirror), 50U * (kMirroredCameras - 1));
}

TEST_F(MirroredRecording, AMirrorThatIsAddedLaterGetsAllFrames) {
  record(60, 500);
  fs::remove_all(mirror);
  const auto session = record(40, 500);
  EXPECT_TRUE(session.copies[0].complete && session.copies[1].complete);
  EXPECT_EQ(stored(mirror), 100U * kMirroredCameras);
  EXPECT_EQ(files_below(take / "archive"), files_below(mirror / "archive"));
}

TEST_F(MirroredRecording, ACopyOfOtherFramesIsRefused) {
  record(20, 500);
  const fs::path kept = folder.path() / "kept";
  fs::copy(mirror, kept, fs::copy_options::recursive);
  const auto resume_one = [&](const fs::path& only) {
    auto cameras = mirrored_cameras(mirrored_script(500, 5));
    std::vector<std::string> ids;
    for (const auto& camera : cameras) ids.push_back(camera.id);
    RecordingTake resumed = RecordingTake::resume(only, ids, "node");
    Recorder(options, std::move(cameras), resumed, "test").run({});
  };
  resume_one(take);
  resume_one(mirror);
  const auto before = files_below(take);
  try {
    record(5, 500);
    ADD_FAILURE() << "two different takes were recorded as copies";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("the copies of the take differ"));
  }
  EXPECT_EQ(stored(take), 25U * kMirroredCameras);
}

/// Records in a child process until it is killed; writes the numbers of stored frames to the pipe.
[[noreturn]] void record_mirrored(const fs::path& take, const fs::path& mirror, int pipe) {
  auto cameras = mirrored_cameras(mirrored_script(2000, 1'000'000));
  BothTakes both(take, mirror, cameras);
  RecorderOptions options;
  options.status_interval_s = 0.005;
  Recorder recorder(options, std::move(cameras), both.takes[0], "test", &both.takes[1]);
  recorder.run({}, [pipe](const RecorderStatus& status) {
    std::array<std::uint64_t, kMirroredCameras> stored{};
    for (std::size_t i = 0; i < stored.size(); ++i) stored[i] = status.cameras[i].stored;
    [[maybe_unused]] const auto written = ::write(pipe, stored.data(), sizeof(stored));
  });
  _exit(0);
}

TEST_F(MirroredRecording, KilledAtRandomTimesBothAreReadableAndResumed) {
  std::mt19937 random(5);
  constexpr int kRounds = 12;
  std::array<std::uint64_t, kMirroredCameras> before{};
  for (int round = 0; round < kRounds; ++round) {
    SCOPED_TRACE(round);
    std::array<int, 2> ends{};
    ASSERT_EQ(pipe(ends.data()), 0);
    const pid_t child = fork();
    if (child == 0) {
      try {
        record_mirrored(take, mirror, ends[1]);
      } catch (const std::exception& error) {
        std::fputs(error.what(), stderr);
      }
      _exit(1);
    }
    ::close(ends[1]);
    std::array<std::uint64_t, kMirroredCameras> stored{}, next{};
    // The first status, so that both copies exist; then a random time.
    ASSERT_EQ(::read(ends[0], next.data(), sizeof(next)), static_cast<ssize_t>(sizeof(next)));
    stored = next;
    std::this_thread::sleep_for(std::chrono::microseconds(random() % 200'000));
    kill(child, SIGKILL);
    int status = 0;
    ASSERT_EQ(waitpid(child, &status, 0), child);
    ASSERT_TRUE(WIFSIGNALED(status));
    while (::read(ends[0], next.data(), sizeof(next)) == static_cast<ssize_t>(sizeof(next))) {
      stored = next;
    }
    ::close(ends[0]);
    const store::Take first(take), second(mirror);
    for (int i = 0; i < kMirroredCameras; ++i) {
      const auto index = static_cast<std::size_t>(i);
      EXPECT_GE(first.archive(i).frames().size(), before[index] + stored[index]);
      // The records of one copy are the beginning of those of the other.
      const auto a = first.archive(i).records(), b = second.archive(i).records();
      const std::size_t common = std::min(a.size(), b.size());
      const auto known = [](const store::FrameRecord& x, const store::FrameRecord& y) {
        return x.time_ns == y.time_ns && x.size == y.size && x.offset == y.offset;
      };
      EXPECT_TRUE(
          std::equal(a.begin(), a.begin() + static_cast<std::ptrdiff_t>(common), b.begin(), known));
      before[index] = std::max(first.archive(i).frames().size(), second.archive(i).frames().size());
    }
  }
  const auto session = record(30, 500);
  EXPECT_TRUE(session.copies[0].complete && session.copies[1].complete);
  EXPECT_EQ(files_below(take), files_below(mirror));
  EXPECT_TRUE(store::verify_take(take, {}).is_intact());
  EXPECT_TRUE(store::verify_take(mirror, {}).is_intact());
}

TEST(FrameQueueOfTwoWriters, KeepsAFrameUntilBothHaveIt) {
  MemoryBudget memory(100'000);
  FrameQueue queue;
  queue.set_writers(2);
  for (int i = 0; i < 6; ++i) {
    auto frame = std::make_shared<QueuedFrame>();
    frame->time_ns = i;
    frame->memory = memory.try_reserve(1000);
    queue.push(std::move(frame));
  }
  const auto write = [&](std::size_t frames, std::size_t writer) {
    EXPECT_EQ(queue.start_writing(frames, writer).size(), frames);
    queue.finish_writing(frames, writer);
  };
  write(4, 0);
  EXPECT_EQ(queue.size(0), 2U);
  EXPECT_EQ(queue.size(1), 6U);
  EXPECT_EQ(memory.used(), 6000U);
  EXPECT_EQ(queue.bytes_only_for(1), 4000U);
  EXPECT_EQ(queue.bytes_only_for(0), 0U);
  write(3, 1);
  EXPECT_EQ(memory.used(), 3000U);
  EXPECT_EQ(queue.bytes_only_for(1), 1000U);
  // Frame 3 is in one copy, frame 4 is the next to be written: frame 5 can be dropped.
  EXPECT_TRUE(queue.drop_one(true, store::FrameStatus::kDroppedRamFull));
  EXPECT_FALSE(queue.drop_one(true, store::FrameStatus::kDroppedRamFull));
  queue.stop_writer(1);
  EXPECT_TRUE(queue.empty(1));
  EXPECT_TRUE(queue.start_writing(5, 1).empty());
  EXPECT_EQ(queue.size_for_all(), 2U);
  write(2, 0);
  EXPECT_EQ(queue.size_for_all(), 0U);
  EXPECT_EQ(memory.used(), 0U);
}

// The thread of a stopped writer may still read its frames, and reports them when its disk answers.
TEST(FrameQueueOfTwoWriters, DropsNoFrameThatAStoppedWriterReads) {
  FrameQueue queue;
  queue.set_writers(2);
  for (int i = 0; i < 6; ++i) {
    auto frame = std::make_shared<QueuedFrame>();
    frame->time_ns = i;
    frame->jpeg.resize(10);
    queue.push(std::move(frame));
  }
  const auto reads = queue.start_writing(3, 1);
  ASSERT_EQ(reads.size(), 3U);
  queue.stop_writer(1);
  const auto drop_all = [&] {
    int dropped = 0;
    while (queue.drop_one(true, store::FrameStatus::kDroppedRamFull)) ++dropped;
    return dropped;
  };
  EXPECT_EQ(drop_all(), 3);
  queue.start_writing(1, 0);
  queue.finish_writing(1, 0);
  EXPECT_EQ(queue.size_for_all(), 5U);
  EXPECT_EQ(drop_all(), 0);
  for (const auto& frame : reads) EXPECT_EQ(frame->jpeg.size(), 10U);
  queue.finish_writing(3, 1);
  EXPECT_TRUE(queue.empty(1));
  EXPECT_EQ(drop_all(), 1) << "the second of them; the first is the next to be written";
}

}  // namespace
}  // namespace raystage::ingest
