// SPDX-License-Identifier: Apache-2.0
// Tests recording to a disk that is nearly full, fills up, or is read-only: a file system of a few
// megabytes, mounted in a private namespace.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "tests/end_to_end/disk_recording.h"

namespace raystage {
namespace {

using testing::CommandResult;
using ::testing::HasSubstr;

const std::string kRecord = "raystage record ../record.json -o take --status none --duration ";
const std::string kSay = "; echo \"exit $?\"; ";

/// A script that waits until frames were written, and then until no more are, so that the queued
/// frames fill the memory. The time depends on the machine.
const std::string kUntilStalled =
    "kb=0; until [ ${kb:-0} -ge 1000 ]; do sleep 0.05; "
    "kb=$(du -ks take/archive 2>/dev/null | cut -f1); done; "
    "free=; until [ \"$free\" = \"$(stat -f -c %a .)\" ]; do "
    "free=$(stat -f -c %a .); sleep 1.2; done; ";

class SmallDisk : public testing::DiskRecordingTest {
 protected:
  void SetUp() override {
    std::filesystem::create_directory(folder() / "disk");
    std::filesystem::create_directory(folder() / "kept");
    const CommandResult mounted = on_disk("1m", "true");
    if (mounted.exit_code != 0) {
      GTEST_SKIP() << "no file system can be mounted here: " << mounted.err;
    }
  }
  /// Runs a script on a disk of that size; copies its contents to kept() at the end.
  CommandResult on_disk(const std::string& size, const std::string& script) const {
    return here("unshare --user --map-root-user --mount bash -c 'mount -t tmpfs -o size=" + size +
                " none disk && cd disk && { " + script + "\ncp -a . ../kept; }'");
  }
  /// Returns a script that changes the size or another mount option of the disk.
  static std::string now(const std::string& option) {
    return "mount -o remount," + option + " \"$PWD\"; ";
  }
  static std::string fill_up() {
    return "{ dd if=/dev/zero of=big bs=4k 2>&1 || :; } >/dev/null; ";
  }
  std::filesystem::path kept() const { return folder() / "kept"; }
};

TEST_F(SmallDisk, FullToTheEndEveryLossIsRecordedAndARoomierOneGoesOn) {
  const CommandResult result =
      on_disk("3m", kRecord + "4" + kSay + "raystage verify -q take >/dev/null" + kSay +
                        now("size=16m") + kRecord + "0.5 --resume" + kSay);
  EXPECT_THAT(result.out, HasSubstr("The audit passed.\nexit 3\nexit 0\n")) << result.err;
  EXPECT_THAT(result.out, ::testing::EndsWith("The audit passed.\nexit 0\n")) << result.err;
  const auto first = session(kept() / "take", 0), second = session(kept() / "take", 1);
  expect_valid_audit(first, 4);
  expect_valid_audit(second, 0.5);
  for (int camera = 0; camera < kCameras; ++camera) {
    const auto& account = first.at("cameras")[camera];
    EXPECT_GT(account.at("stored"), 5);
    EXPECT_GT(account.at("dropped").at("dropped, could not be written"), 0);
    EXPECT_GT(account.at("dropped").at("dropped, memory full"), 0);
    EXPECT_EQ(dropped(second.at("cameras")[camera]), 0);
    const auto all = records(kept() / "take", camera);
    EXPECT_EQ(count(all, store::FrameStatus::kDroppedDiskFull),
              account.at("dropped").at("dropped, could not be written"));
    EXPECT_EQ(count(all, store::FrameStatus::kDroppedRamFull),
              account.at("dropped").at("dropped, memory full"));
  }
  EXPECT_EQ(here("raystage verify -q --decode kept/take").exit_code, 0);
  EXPECT_FALSE(std::filesystem::exists(kept() / "take" / ".reserve"));
}

TEST_F(SmallDisk, RoomThatIsMadeMeanwhileIsUsed) {
  const CommandResult result = on_disk(
      "3m", "{ " + kRecord + "8 & }; " + kUntilStalled + now("size=16m") + "wait $!" + kSay);
  EXPECT_THAT(result.out, HasSubstr("The audit passed.\nexit 3\n")) << result.err;
  const auto account = session(kept() / "take");
  expect_valid_audit(account, 8);
  for (int camera = 0; camera < kCameras; ++camera) {
    EXPECT_FALSE(
        account.at("cameras")[camera].at("dropped").contains("dropped, could not be written"));
    const auto all = records(kept() / "take", camera);
    EXPECT_GT(count(all, store::FrameStatus::kDroppedRamFull), 0);
    ASSERT_GT(all.size(), 20U);
    for (const store::FrameRecord& frame : std::span(all).last(10)) {
      EXPECT_EQ(frame.status, store::FrameStatus::kStored);
    }
  }
}

// Less space than is reserved on other disks, and more records than fit next to the frames.
TEST_F(SmallDisk, NearlyFullFromTheStartEveryLossIsRecorded) {
  write_config("drop_newest", 32);
  const CommandResult result = on_disk("400k", kRecord + "8" + kSay);
  EXPECT_THAT(result.out, HasSubstr("The audit passed.\nexit 3\n")) << result.err;
  expect_valid_audit(session(kept() / "take"), 8);
  EXPECT_EQ(here("raystage verify -q kept/take").exit_code, 0);
}

TEST_F(SmallDisk, FullFromTheStartNothingIsBegunAndNothingChanged) {
  const CommandResult result =
      on_disk("6m", kRecord + "0.5" + kSay + fill_up() + "cp -a take ../before; " + kRecord +
                        "0.5 --resume" + kSay + "diff -r take ../before" + kSay +
                        testing::replaced(kRecord, "-o take", "-o new") + "0.5" + kSay + "ls -A");
  EXPECT_THAT(result.out, ::testing::EndsWith("exit 1\nexit 0\nexit 1\nbig\ntake\n")) << result.err;
  EXPECT_THAT(result.err, HasSubstr("one.json: cannot write the file: No space left on device"));
}

TEST_F(SmallDisk, ReadOnlyFromTheStartIsSaid) {
  const CommandResult result =
      on_disk("6m", kRecord + "0.5" + kSay + now("ro") + kRecord + "0.5 --resume" + kSay +
                        "raystage verify -q take >/dev/null" + kSay +
                        testing::replaced(kRecord, "-o take", "-o new") + "0.5" + kSay + now("rw") +
                        "ls -A");
  EXPECT_THAT(result.out, ::testing::EndsWith("exit 1\nexit 0\nexit 1\ntake\n")) << result.err;
  EXPECT_THAT(result.err, HasSubstr("a.mkv: the file cannot be opened for writing: Read-only"));
  EXPECT_THAT(result.err, HasSubstr("cannot create the folder: Read-only file system"));
}

TEST_F(SmallDisk, AFullMirrorCostsNoFrameAndIsCompletedFromTheTake) {
  std::filesystem::create_directory(folder() / "whole");
  const CommandResult result =
      on_disk("3m",
              "raystage record ../record.json -o ../whole/take --mirror . --memory 4 --status json "
              "--duration 9 >../status" +
                  kSay + "raystage info take >/dev/null" + kSay);
  EXPECT_THAT(result.out, ::testing::EndsWith("exit 4\nexit 0\n")) << result.err;
  EXPECT_THAT(result.err, HasSubstr("refuses frames, which wait in memory: "));
  EXPECT_THAT(result.err, HasSubstr("ONLY ONE COPY IS RECORDED, ./take was stopped: "));
  EXPECT_THAT(result.err, HasSubstr("No space left on device"));
  EXPECT_THAT(result.err, HasSubstr("THIS COPY IS INCOMPLETE: ./take"));
  EXPECT_THAT(testing::read_text(folder() / "status"), HasSubstr(R"("stopped":"./take/archive/)"));
  const auto account = session(folder() / "whole/take");
  expect_valid_audit(account, 9);
  EXPECT_TRUE(account.at("copies")[0].at("complete").get<bool>());
  EXPECT_FALSE(account.at("copies")[1].at("complete").get<bool>());
  for (const auto& camera : account.at("cameras")) EXPECT_EQ(dropped(camera), 0) << camera.dump(1);
  EXPECT_EQ(here("raystage verify -q whole/take").exit_code, 0);

  const CommandResult planned = here("raystage repair -q --dry-run kept/take --from whole/take");
  EXPECT_EQ(planned.exit_code, 0) << planned.out << planned.err;
  EXPECT_THAT(planned.out, HasSubstr("frames taken from the copy: "));
  EXPECT_NE(here("diff -r kept/take whole/take").exit_code, 0);
  EXPECT_EQ(here("raystage repair -q kept/take --from whole/take").exit_code, 0);
  EXPECT_EQ(here("diff -r -x '*.damaged' -x events.jsonl kept/take whole/take").exit_code, 0);
}

}  // namespace
}  // namespace raystage
