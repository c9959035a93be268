// SPDX-License-Identifier: Apache-2.0
// raystage sync and raystage info as users run them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "testing/cli/test_command.h"
#include "testing/store/take_test_data.h"
#include "testing/test_folder.h"

namespace raystage::cli {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

struct TakeCommands : ::testing::Test {
  TakeCommands() {
    std::vector<std::vector<Nanoseconds>> times(4);
    for (int camera = 0; camera < 4; ++camera) {
      for (int i = 0; i < 10; ++i) {
        if (camera != 2 || i != 5) {
          times[camera].push_back(i * 50'000'000 + camera * 1'000'000);
        }
      }
    }
    testing::write_take(take, times, 20);
  }

  static testing::CommandResult run(const std::string& arguments) {
    return testing::run_raystage(arguments);
  }

  testing::TestFolder folder;
  std::filesystem::path take = folder.path() / "a take";
  std::string quoted = "'" + take.string() + "'";
};

TEST_F(TakeCommands, AnArchiveCutWithinItsCuesIsNoInterruptedRecording) {
  const std::filesystem::path archive = take / "archive/c1.mkv";
  std::filesystem::resize_file(archive, std::filesystem::file_size(archive) - 9);
  const testing::CommandResult info = run("info " + quoted);
  EXPECT_EQ(info.exit_code, 0) << info.output;
  EXPECT_THAT(info.output, AllOf(HasSubstr("1 shorter than when closed: c1"),
                                 HasSubstr("no frame is lost"), Not(HasSubstr("interrupted"))));
}

TEST_F(TakeCommands, AnEmptyIdentifierIsRefused) {
  const testing::CommandResult bag = run("bag " + quoted + " -o bag --identifier ''");
  EXPECT_EQ(bag.exit_code, 2);
  EXPECT_THAT(bag.output, HasSubstr("the identifier is empty"));
}

TEST_F(TakeCommands, SyncThenInfo) {
  testing::CommandResult info = run("info " + quoted);
  EXPECT_EQ(info.exit_code, 0) << info.output;
  EXPECT_THAT(info.output, HasSubstr("raystage sync"));
  EXPECT_THAT(info.output, HasSubstr("320 x 240 pixels"));
  EXPECT_THAT(info.output, HasSubstr("39; 9 to 10 a camera"));
  EXPECT_THAT(info.output, HasSubstr("4, all closed"));

  const testing::CommandResult sync = run("sync " + quoted);
  EXPECT_EQ(sync.exit_code, 0) << sync.output;
  EXPECT_THAT(sync.output, HasSubstr("20 Hz"));
  EXPECT_THAT(sync.output, HasSubstr("mean 3.000 ms, median 3.000 ms, at most 3.000 ms"));
  EXPECT_THAT(sync.output, HasSubstr("1 of 40 frames"));
  EXPECT_THAT(sync.output, HasSubstr("c2"));
  EXPECT_THAT(sync.output, Not(HasSubstr("c1")));

  info = run("info " + quoted);
  EXPECT_THAT(info.output, HasSubstr("10 ticks at 20 Hz; spread mean 3.000 ms"));
}

TEST_F(TakeCommands, Json) {
  const testing::CommandResult sync = run("sync --json --fps 20 --tolerance 10 " + quoted);
  ASSERT_EQ(sync.exit_code, 0) << sync.output;
  const auto synced = nlohmann::json::parse(sync.output);
  EXPECT_EQ(synced["ticks"], 10);
  EXPECT_EQ(synced["tolerance_ns"], 10'000'000);
  EXPECT_EQ(synced["absent"], (nlohmann::json{{"c2", 1}}));
  const testing::CommandResult info = run("info --json " + quoted);
  ASSERT_EQ(info.exit_code, 0) << info.output;
  const auto json = nlohmann::json::parse(info.output);
  EXPECT_EQ(json["frames"], 39);
  EXPECT_EQ(json["cameras"].size(), 4u);
  EXPECT_EQ(json["cameras"][2]["frames"], 9);
  EXPECT_EQ(json["timeline"]["absent_total"], 1);
  EXPECT_NEAR(json["alias_free_distance_m"].get<double>(), 7.99, 0.005);
}

TEST_F(TakeCommands, SayWhatIsAssumedAboutShutters) {
  EXPECT_THAT(run("info " + quoted).output, HasSubstr("Shutter     global"));
  EXPECT_THAT(run("sync " + quoted).output, Not(HasSubstr("Shutter")));
  schemas::RigDocument rig = testing::rig_document(4);
  rig.cameras[0].geometry.line_time_us = rig.cameras[3].geometry.line_time_us = 62.5;
  schemas::write_rig(rig, take / "rig.json");
  const std::string found =
      "rolling in 2 of 4 cameras: line time 62.5 us, read-out 15 ms a frame (rig.json)";
  EXPECT_THAT(run("info " + quoted).output, HasSubstr(found));
  EXPECT_THAT(run("sync " + quoted).output, HasSubstr(found));
  const auto json = nlohmann::json::parse(run("info --json " + quoted).output);
  EXPECT_EQ(json["shutter"]["kind"], "rolling");
  EXPECT_EQ(json["shutter"]["read_out_ms"], (nlohmann::json{15, 15}));
}

TEST_F(TakeCommands, SyncFindsLineTimesThatNoFrameHas) {
  schemas::RigDocument rig = testing::rig_document(4);
  rig.cameras[2].geometry.line_time_us = 62500;  // nanoseconds
  schemas::write_rig(rig, take / "rig.json");
  const testing::CommandResult warned = run("sync -q " + quoted);
  EXPECT_EQ(warned.exit_code, 0);
  EXPECT_THAT(warned.output, AllOf(HasSubstr("rig.json: camera c2: with the line time of 62500 us"),
                                   HasSubstr("take 15000 ms, longer than a frame time of"),
                                   HasSubstr("Correct line_time_us")));
  const std::filesystem::path moved = folder.path() / "moved";
  const testing::CommandResult refused =
      run("sync -q --retime flow -o '" + moved.string() + "' " + quoted);
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.output, HasSubstr("camera c2"));
  EXPECT_FALSE(std::filesystem::exists(moved));
}

TEST_F(TakeCommands, GuessedPlacesAreNotMeasured) {
  schemas::RigDocument rig = testing::rig_document(4);
  rig.name = schemas::kUncalibratedRigName;
  schemas::write_rig(rig, take / "rig.json");
  const testing::CommandResult info = run("info " + quoted);
  EXPECT_THAT(info.output, HasSubstr("Spacing     unknown: the rig is not calibrated"));
  EXPECT_THAT(info.output, Not(HasSubstr("apart")));
  EXPECT_THAT(info.output, Not(HasSubstr("Alias-free")));
  const auto json = nlohmann::json::parse(run("info --json " + quoted).output);
  EXPECT_EQ(json["calibrated"], false);
  EXPECT_TRUE(json["spacing_m"].is_null());
  EXPECT_TRUE(json["alias_free_distance_m"].is_null());
}

TEST_F(TakeCommands, BadUsageAndInputExitWithTwo) {
  for (const char* command : {"info", "sync"}) {
    const std::string name(command);
    EXPECT_EQ(run(name).exit_code, 2);
    EXPECT_EQ(run(name + " --nonsense " + quoted).exit_code, 2);
    const testing::CommandResult missing =
        run(name + " '" + (folder.path() / "nothing").string() + "'");
    EXPECT_EQ(missing.exit_code, 2);
    EXPECT_THAT(missing.output, HasSubstr("take.json"));
    EXPECT_EQ(run(name + " --help").exit_code, 0);
  }
  for (const char* option :
       {"--fps 0", "--fps -1", "--fps nan", "--fps inf", "--tolerance -1", "--tolerance x"}) {
    EXPECT_EQ(run("sync " + std::string(option) + " " + quoted).exit_code, 2) << option;
  }
  EXPECT_FALSE(std::filesystem::exists(take / "timeline.zst"));
}

TEST_F(TakeCommands, InfoSaysWhichArchiveIsLost) {
  std::filesystem::remove(take / "archive" / "c1.mkv");
  const testing::CommandResult info = run("info " + quoted);
  EXPECT_EQ(info.exit_code, 2);
  EXPECT_THAT(info.output, HasSubstr("c1.mkv"));
  EXPECT_THAT(info.output, HasSubstr("29; 0 to 10 a camera"));
}

TEST_F(TakeCommands, AnAnswerThatCannotBeWrittenIsAFailure) {
  if (!std::filesystem::exists("/dev/full")) GTEST_SKIP() << "no /dev/full";
  // The error message cannot be written either.
  for (const std::string& command : {"info " + quoted, "info --json " + quoted, "sync " + quoted}) {
    EXPECT_EQ(run(command + " 1>/dev/full").exit_code, 1) << command;
  }
}

/// Moves a file or folder of the take out of it and leaves a link.
void replace_by_link(const std::filesystem::path& take, const std::string& name,
                     const std::filesystem::path& outside) {
  std::filesystem::rename(take / name, outside);
  std::filesystem::create_symlink(outside, take / name);
}

TEST_F(TakeCommands, LinksInATakeAreFollowedOnlyOnRequest) {
  ASSERT_EQ(run("sync -q " + quoted).exit_code, 0);
  const std::string info = run("info " + quoted).output;
  for (const std::string name : {"take.json", "rig.json", "timeline.zst", "archive",
                                 "archive/c1.mkv", "archive/c1.journal"}) {
    const std::filesystem::path outside = folder.path() / "outside";
    replace_by_link(take, name, outside);
    for (const std::string command : {"info ", "verify -q ", "sync -q -o NEW "}) {
      std::string words = command;
      if (const auto at = words.find("NEW"); at != std::string::npos) {
        if (name == "timeline.zst") continue;  // it is not read
        words.replace(at, 3, "'" + (folder.path() / "new").string() + "'");
      }
      const testing::CommandResult refused = run(words + quoted);
      EXPECT_THAT(refused.output, HasSubstr("a part of the path is a link")) << words << name;
      EXPECT_FALSE(std::filesystem::exists(folder.path() / "new")) << name;
      if (name != "timeline.zst") {
        EXPECT_NE(refused.exit_code, 0) << words << name;
      }
    }
    EXPECT_EQ(run("info --follow-links " + quoted).output, info) << name;
    const testing::CommandResult verified = run("verify -q --follow-links " + quoted);
    EXPECT_EQ(verified.exit_code, 0) << name << verified.output;
    std::filesystem::remove(take / name);
    std::filesystem::rename(outside, take / name);
  }
  EXPECT_EQ(run("info " + quoted).output, info);
}

TEST_F(TakeCommands, InfoOfALargeArrayNamesTheCamerasThatMissMost) {
  const std::filesystem::path large = folder.path() / "large";
  std::vector<std::vector<Nanoseconds>> times(20);
  for (std::size_t camera = 0; camera < times.size(); ++camera) {
    for (int i = 0; i < 10; ++i) times[camera].push_back(i * 50'000'000);
  }
  testing::write_take(large, times, 20);
  for (int camera = 0; camera < 20; ++camera) {
    const auto file = large / "archive" / ("c" + std::to_string(camera) + ".mkv");
    std::filesystem::resize_file(file, std::filesystem::file_size(file) / (camera == 7 ? 4 : 2));
  }
  const testing::CommandResult info = run("info '" + large.string() + "'");
  EXPECT_THAT(info.output, HasSubstr("in 20 cameras"));
  EXPECT_THAT(info.output, HasSubstr("\n  c7 "));
  EXPECT_THAT(info.output, HasSubstr("and 16 cameras more"));
}

TEST_F(TakeCommands, InfoOfACutArchive) {
  const auto file = take / "archive" / "c3.mkv";
  std::filesystem::resize_file(file, std::filesystem::file_size(file) / 2);
  const testing::CommandResult info = run("info " + quoted);
  EXPECT_EQ(info.exit_code, 0);
  EXPECT_THAT(info.output, HasSubstr("1 shorter than when closed: c3"));
  EXPECT_THAT(info.output, HasSubstr(" after the archive's end"));
  EXPECT_THAT(info.output, HasSubstr("raystage verify " + take.string()));
  EXPECT_THAT(info.output, HasSubstr("raystage repair " + take.string() + " --from COPY"));
  EXPECT_THAT(info.output, Not(HasSubstr("torn")));
}

TEST_F(TakeCommands, InfoOfAnInterruptedRecording) {
  // As a recorder leaves it: the Segment has no size yet.
  const auto file = take / "archive" / "c3.mkv";
  std::string bytes = read_file(file);
  const auto segment = bytes.find("\x18\x53\x80\x67");
  ASSERT_NE(segment, std::string::npos);
  bytes.replace(segment + 4, 8, "\x01\xff\xff\xff\xff\xff\xff\xff");
  write_file_atomically(file, bytes.substr(0, bytes.size() / 2));
  const testing::CommandResult info = run("info " + quoted);
  EXPECT_THAT(info.output, HasSubstr("1 not closed"));
  EXPECT_THAT(info.output, HasSubstr(" torn"));
  EXPECT_THAT(info.output, HasSubstr("--resume -o " + take.string()));
  EXPECT_THAT(info.output, HasSubstr("raystage repair " + take.string()));
}

}  // namespace
}  // namespace raystage::cli
