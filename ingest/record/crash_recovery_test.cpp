// SPDX-License-Identifier: Apache-2.0
// Kills recordings at random times. Every frame that was reported as stored must be readable, and
// the recording must be resumable.
#include <gtest/gtest.h>
#include <sys/wait.h>
#include <unistd.h>

#include <csignal>
#include <cstdio>
#include <random>
#include <thread>

#include "base/error.h"
#include "ingest/record/open_cameras.h"
#include "ingest/record/record_setup.h"
#include "store/jpeg/encode.h"
#include "store/take.h"
#include "testing/ingest/scripted_source.h"
#include "testing/store/test_images.h"
#include "testing/test_folder.h"

#ifdef __SANITIZE_THREAD__
// Libraries start threads before main. By default the thread sanitizer ends a child process that
// starts threads after a fork.
extern "C" const char* __tsan_default_options();
extern "C" const char* __tsan_default_options() { return "die_after_fork=0"; }
#endif

namespace raystage::ingest {
namespace {

constexpr int kCameras = 3;

testing::SourceScript endless() {
  testing::SourceScript script;
  for (std::uint32_t seed = 1; seed <= 3; ++seed) {
    SourceFrame frame;
    frame.jpeg = store::encode_jpeg(testing::make(testing::Kind::kMixed, 64, 48, seed), {});
    script.frames.push_back(std::move(frame));
  }
  script.fps = 2000;
  return script;
}

/// Records in a child process until it is killed. Writes the number of stored frames of each
/// archive to the pipe.
[[noreturn]] void record_until_killed(const std::filesystem::path& path, bool resume, int pipe) {
  schemas::RecordConfig config;
  config.name = "test";
  std::vector<std::string> ids;
  for (int i = 0; i < kCameras; ++i) {
    ids.push_back("c" + std::to_string(i));
    config.cameras.push_back({ids.back(), schemas::RecordConfig::SimulatedSource{}});
  }
  auto cameras = open_cameras(config, [](const schemas::RecordConfig::Camera&) {
    return testing::make_scripted_source(endless());
  });
  RecordingTake take =
      resume ? RecordingTake::resume(path, ids, "node")
             : RecordingTake::create(
                   path, make_take_document(config, cameras, "node", host_utc_now(), "test"),
                   make_recording_rig(config, {}, cameras), "node");
  RecorderOptions options;
  options.status_interval_s = 0.005;
  Recorder recorder(options, std::move(cameras), take, "test");
  recorder.run({}, [pipe](const RecorderStatus& status) {
    std::array<std::uint64_t, kCameras> stored{};
    for (std::size_t i = 0; i < stored.size(); ++i) stored[i] = status.cameras[i].stored;
    [[maybe_unused]] const auto written = ::write(pipe, stored.data(), sizeof(stored));
  });
  _exit(0);
}

TEST(KilledRecording, LosesNoStoredFrameAndResumes) {
  constexpr int kRounds = 20;
  const testing::TestFolder folder;
  const auto path = folder.path() / "take";
  std::mt19937 random(5);
  std::array<std::uint64_t, kCameras> before{};
  for (int round = 0; round < kRounds; ++round) {
    std::array<int, 2> ends{};
    ASSERT_EQ(pipe(ends.data()), 0);
    const bool resume = std::filesystem::exists(path / "take.json");
    if (!resume) std::filesystem::remove_all(path);
    const pid_t child = fork();
    if (child == 0) {
      try {
        record_until_killed(path, resume, ends[1]);
      } catch (const std::exception& error) {
        std::fputs(error.what(), stderr);
      }
      _exit(3);
    }
    close(ends[1]);
    std::array<std::uint64_t, kCameras> acknowledged{}, said{};
    // In every other round, waits until the recording has begun, even on a slow machine.
    if (round % 2 == 0 && read(ends[0], said.data(), sizeof(said)) == sizeof(said)) {
      acknowledged = said;
    }
    std::this_thread::sleep_for(std::chrono::milliseconds(30 + random() % 120));
    kill(child, SIGKILL);
    int status = 0;
    waitpid(child, &status, 0);
    ASSERT_TRUE(WIFSIGNALED(status)) << "the recording ended by itself in round " << round;
    while (read(ends[0], said.data(), sizeof(said)) == sizeof(said)) acknowledged = said;
    close(ends[0]);
    if (!std::filesystem::exists(path / "take.json")) continue;  // killed before it began

    const store::Take take(path);
    for (int i = 0; i < kCameras; ++i) {
      const store::ArchiveReader& archive = take.archive(i);
      const auto at = static_cast<std::size_t>(i);
      EXPECT_GE(archive.frames().size(), before[at] + acknowledged[at]) << "round " << round;
      before[at] = archive.frames().size();
    }
  }
  // Every frame equals one of the three recorded JPEG files.
  const testing::SourceScript script = endless();
  const store::Take take(path);
  std::size_t stored = 0;
  for (int i = 0; i < kCameras; ++i) {
    const store::ArchiveReader& archive = take.archive(i);
    EXPECT_GT(archive.frames().size(), 100U);
    stored += archive.frames().size();
    for (int frame = 0; frame < static_cast<int>(archive.frames().size()); ++frame) {
      const auto jpeg = archive.jpeg(frame);
      EXPECT_TRUE(std::ranges::any_of(script.frames, [&](const SourceFrame& known) {
        return std::ranges::equal(known.jpeg, jpeg);
      }));
    }
  }
  std::printf("%d times killed: %zu frames, each whole, none lost that was reported as stored\n",
              kRounds, stored);
}

}  // namespace
}  // namespace raystage::ingest
