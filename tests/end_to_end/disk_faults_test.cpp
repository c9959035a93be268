// SPDX-License-Identifier: Apache-2.0
// Tests recording to a disk that is slow, stalls, fails writes or loses accepted data, simulated by
// disk_faults.cpp, which is preloaded into the command.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "testing/test_paths.h"
#include "tests/end_to_end/disk_recording.h"

namespace raystage {
namespace {

using nlohmann::json;
using testing::CommandResult;
using ::testing::HasSubstr;

class BadDisk : public testing::DiskRecordingTest {
 protected:
  CommandResult record(const std::string& fault, double seconds,
                       const std::string& options = "--status json") const {
    return here("export BAD_DISK_FOLDER=" + take().string() + " BAD_DISK='" + fault + "'" +
                kSanitizer + "; LD_PRELOAD='" + testing::disk_faults_library().string() +
                "' raystage record record.json -o take --duration " + std::to_string(seconds) +
                " " + options);
  }
  std::filesystem::path take() const { return folder() / "take"; }

  /// Expects that the recorder waited for a disk that failed for two of five seconds, and recorded
  /// as dropped the frames for which the memory did not suffice.
  void expect_recovery(const CommandResult& result, const std::string& trouble) const {
    EXPECT_EQ(result.exit_code, 3) << result.err;
    const json account = session(take());
    expect_valid_audit(account, 5);
    std::string said;
    const auto lines = status_lines(result);
    for (const json& line : lines) {
      said += line.at("trouble");
      EXPECT_LE(line.at("memory_used_bytes"), line.at("memory_limit_bytes"));
    }
    EXPECT_THAT(said, HasSubstr(trouble));
    EXPECT_EQ(said.empty(), trouble.empty());
    EXPECT_EQ(lines.back().at("trouble"), "");
    for (int camera = 0; camera < kCameras; ++camera) {
      const auto all = records(take(), camera);
      EXPECT_GT(count(all, store::FrameStatus::kDroppedRamFull), 3);
      EXPECT_EQ(static_cast<long>(all.size()), count(all, store::FrameStatus::kStored) +
                                                   count(all, store::FrameStatus::kDroppedRamFull));
      ASSERT_GT(all.size(), 30U);
      for (const auto& part : {std::span(all).first(3), std::span(all).last(10)}) {
        for (const store::FrameRecord& frame : part)
          EXPECT_EQ(frame.status, store::FrameStatus::kStored);
      }
    }
    EXPECT_EQ(here("raystage verify -q --decode take").exit_code, 0);
  }

#ifdef __SANITIZE_ADDRESS__
  // Here the preloaded library must come before the sanitizer's.
  static constexpr const char* kSanitizer =
      " ASAN_OPTIONS=\"$ASAN_OPTIONS:verify_asan_link_order=0\"";
#else
  static constexpr const char* kSanitizer = "";
#endif
};

TEST_F(BadDisk, ASlowOneFillsMemoryAndEveryDropIsRecorded) {
  for (const bool oldest : {false, true}) {
    SCOPED_TRACE(oldest);
    std::filesystem::remove_all(take());
    write_config(oldest ? "drop_oldest" : "drop_newest");
    const CommandResult result = record("SLOW 400000", 4);
    EXPECT_EQ(result.exit_code, 3) << result.err;
    expect_valid_audit(session(take()), 4);
    bool full = false;
    for (const json& line : status_lines(result)) {
      const auto used = line.at("memory_used_bytes").get<double>();
      const auto limit = line.at("memory_limit_bytes").get<double>();
      EXPECT_LE(used, limit);
      // The status is printed once a second, and the memory of a batch is freed at once.
      full = full || used > 0.5 * limit;
    }
    EXPECT_TRUE(full);
    for (int camera = 0; camera < kCameras; ++camera) {
      const auto all = records(take(), camera);
      EXPECT_EQ(session(take()).at("cameras")[camera].at("dropped"),
                json({{"dropped, memory full", count(all, store::FrameStatus::kDroppedRamFull)}}));
      // The policy keeps the first or the last frames in memory.
      ASSERT_GT(all.size(), 10U);
      for (const store::FrameRecord& frame :
           oldest ? std::span(all).last(3) : std::span(all).first(5)) {
        EXPECT_EQ(frame.status, store::FrameStatus::kStored);
      }
      for (std::size_t i = 1; i < all.size(); ++i) {
        EXPECT_EQ(all[i].sequence, all[i - 1].sequence + 1);
      }
    }
    EXPECT_EQ(here("raystage verify -q take").exit_code, 0);
  }
}

TEST_F(BadDisk, OneThatStallsIsWaitedFor) { expect_recovery(record("STALL 500000 2", 5), ""); }

TEST_F(BadDisk, OneThatIsFullForAWhileIsWaitedFor) {
  expect_recovery(record("ENOSPC 500000 2", 5), "No space left on device");
}

TEST_F(BadDisk, OneThatIsReadOnlyForAWhileIsWaitedFor) {
  expect_recovery(record("EROFS 500000 2", 5), "Read-only file system");
}

// Data that the disk accepted before may be lost, so the audit must fail.
TEST_F(BadDisk, OneThatCouldNotKeepWhatItTookFailsTheAudit) {
  const CommandResult result = record("SYNC 500000 1.2", 3);
  EXPECT_EQ(result.exit_code, 1) << result.err;
  const json account = session(take());
  EXPECT_FALSE(account.at("audit").at("passed").get<bool>());
  ASSERT_EQ(account.at("audit").at("problems").size(), 1U);
  EXPECT_THAT(account.at("audit").at("problems")[0].get<std::string>(),
              HasSubstr("cannot be synced to the disk: Input/output error"));
  for (const json& camera : account.at("cameras")) {
    EXPECT_EQ(camera.at("stored"), camera.at("arrived"));
  }
}

// The faults are on the mirror's disk only, and last longer than the recording, but for the first.
TEST_F(BadDisk, AMirrorThatIsSlowOrFailsCostsNoFrame) {
  const std::pair<const char*, const char*> faults[] = {{"SLOW 150000", "too slow"},
                                                        {"EIO 500000 1000", "Input/output error"},
                                                        {"SYNC 500000 1000", "cannot be synced"}};
  for (const auto& [fault, reason] : faults) {
    SCOPED_TRACE(fault);
    std::filesystem::remove_all(take());
    std::filesystem::remove_all(folder() / "disk");
    std::filesystem::create_directory(folder() / "disk");
    const CommandResult result =
        here("export BAD_DISK_FOLDER=" + (folder() / "disk").string() + " BAD_DISK='" + fault +
             "'" + kSanitizer + "; LD_PRELOAD='" + testing::disk_faults_library().string() +
             "' raystage record record.json -o take --mirror disk --memory 3 --status none "
             "--duration 6");
    EXPECT_EQ(result.exit_code, 4) << result.err;
    EXPECT_THAT(result.err, HasSubstr("ONLY ONE COPY IS RECORDED, disk/take was stopped: "));
    EXPECT_THAT(result.err, HasSubstr(reason));
    const json account = session(take());
    expect_valid_audit(account, 6);
    for (const json& camera : account.at("cameras")) {
      EXPECT_EQ(camera.at("stored"), camera.at("arrived")) << camera.dump(1);
    }
    EXPECT_EQ(here("raystage verify -q take").exit_code, 0);
    EXPECT_EQ(here("raystage repair -q disk/take --from take").exit_code, 0);
    EXPECT_EQ(here("diff -r -x '*.damaged' -x events.jsonl disk/take take").exit_code, 0);
  }
}

// The take's own disk fails: the mirror has everything, and the take is repaired from it.
TEST_F(BadDisk, TheMirrorGoesOnWithoutTheTake) {
  std::filesystem::create_directory(folder() / "disk");
  const CommandResult result =
      record("EIO 500000 1000", 6, "--mirror disk --memory 3 --status none");
  EXPECT_EQ(result.exit_code, 4) << result.err;
  EXPECT_THAT(result.err, HasSubstr("ONLY ONE COPY IS RECORDED, take was stopped: "));
  const json account = session(folder() / "disk" / "take");
  expect_valid_audit(account, 6);
  for (const json& camera : account.at("cameras")) {
    EXPECT_EQ(camera.at("stored"), camera.at("arrived")) << camera.dump(1);
  }
  EXPECT_EQ(here("raystage verify -q disk/take").exit_code, 0);
  EXPECT_EQ(here("raystage repair -q take --from disk/take").exit_code, 0);
  EXPECT_EQ(here("diff -r -x '*.damaged' -x events.jsonl disk/take take").exit_code, 0);
}

struct Refusal {
  const char* name;
  const char* text;
  friend void PrintTo(const Refusal& refusal, std::ostream* out) { *out << refusal.name; }
};
class RefusingDisk : public BadDisk, public ::testing::WithParamInterface<Refusal> {};

// Losses cannot be recorded on such a disk: they are printed, and stored frames remain.
TEST_P(RefusingDisk, ForGoodIsSaidAndTheTakeGoesOnElsewhen) {
  const CommandResult result =
      record(GetParam().name + std::string(" 500000 1000"), 2, "--status none");
  EXPECT_EQ(result.exit_code, 1) << result.err;
  EXPECT_THAT(result.out, HasSubstr("THE AUDIT FAILED"));
  EXPECT_THAT(result.out, HasSubstr("frames arrived,"));
  EXPECT_THAT(result.out, HasSubstr(GetParam().text));
  EXPECT_FALSE(session(take()).contains("audit"));  // only the start of the session is recorded
  const auto before = records(take(), 0);
  EXPECT_GT(count(before, store::FrameStatus::kStored), 0);

  const CommandResult resumed =
      here("raystage record record.json -o take --resume --duration 0.5 --status none");
  EXPECT_EQ(resumed.exit_code, 0) << resumed.err;
  expect_valid_audit(session(take(), 1), 0.5);
  EXPECT_EQ(here("raystage verify -q take").exit_code, 0);
  const auto after = records(take(), 0);
  ASSERT_GT(after.size(), before.size());
  for (std::size_t i = 0; i < before.size(); ++i) EXPECT_EQ(after[i].time_ns, before[i].time_ns);
}

INSTANTIATE_TEST_SUITE_P(Reasons, RefusingDisk,
                         ::testing::Values(Refusal{"ENOSPC", "No space left on device"},
                                           Refusal{"EROFS", "Read-only file system"},
                                           Refusal{"EIO", "Input/output error"}),
                         [](const auto& test) { return std::string(test.param.name); });

}  // namespace
}  // namespace raystage
