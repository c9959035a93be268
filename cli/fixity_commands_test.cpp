// SPDX-License-Identifier: Apache-2.0
// raystage verify and raystage repair as an archivist runs them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "testing/cli/test_command.h"
#include "testing/store/take_test_data.h"
#include "testing/test_folder.h"

namespace raystage::cli {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;

struct FixityCommands : ::testing::Test {
  FixityCommands() {
    std::vector<std::vector<Nanoseconds>> times(3);
    for (auto& column : times) {
      for (int i = 0; i < 10; ++i) column.push_back(i * 50'000'000);
    }
    testing::write_take(take, times, 20);
  }

  static testing::CommandResult run(const std::string& arguments) {
    return testing::run_raystage(arguments);
  }
  void flip(const std::string& name, std::size_t byte) const {
    auto bytes = testing::bytes_of(take / "archive" / name);
    bytes.at(byte) ^= std::byte{1};
    testing::overwrite(take / "archive" / name, bytes);
  }
  std::size_t frame_offset(int camera, std::size_t frame) const {
    return static_cast<std::size_t>(store::Take(take).archive(camera).frames()[frame].offset);
  }

  testing::TestFolder folder;
  std::filesystem::path take = folder.path() / "a take";
  std::string quoted = "'" + take.string() + "'";
};

TEST_F(FixityCommands, AWholeTake) {
  for (const char* depth : {"", "--depth sizes ", "--depth journal ", "--depth hashes -j 1 "}) {
    const testing::CommandResult verify = run("verify -q " + std::string(depth) + quoted);
    EXPECT_EQ(verify.exit_code, 0) << verify.output;
    EXPECT_THAT(verify.output, HasSubstr("3 cameras: 3 intact, 0 not closed, 0 damaged"));
  }
  EXPECT_THAT(run("verify " + quoted).output, HasSubstr("Progress: 100%"));
  const testing::CommandResult repair = run("repair -q -j 2 " + quoted);
  EXPECT_EQ(repair.exit_code, 0) << repair.output;
  EXPECT_THAT(repair.output, HasSubstr("3 of 3 cameras were intact"));
}

TEST_F(FixityCommands, AManifestNamesWhatIsNotAsItWas) {
  const testing::CommandResult none = run("verify -q --manifest check " + quoted);
  EXPECT_EQ(none.exit_code, 2) << none.output;
  EXPECT_THAT(none.output, HasSubstr("3 cameras: 3 intact"));  // comes all the same
  EXPECT_EQ(run("verify -q --manifest write " + quoted).exit_code, 0);
  const testing::CommandResult same = run("verify -q --manifest check " + quoted);
  EXPECT_EQ(same.exit_code, 0) << same.output;
  EXPECT_THAT(same.output, HasSubstr("0 changed, 0 missing, 0 not listed"));

  write_file_atomically(take / "added.txt", "x");
  const auto json =
      nlohmann::json::parse(run("verify -q --json - --manifest check " + quoted).output);
  EXPECT_EQ(json["manifest"]["unlisted"][0], "added.txt");
  EXPECT_EQ(json["intact"], true);
  EXPECT_EQ(run("verify -q --manifest check " + quoted).exit_code, 1);

  // A manifest would state that a damaged take is good.
  flip("c1.mkv", frame_offset(1, 4) + 3);
  const testing::CommandResult refused = run("verify -q --manifest write " + quoted);
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_THAT(refused.output, HasSubstr("no manifest was written"));

  // Documents that cannot be read any more are named, too.
  write_file_atomically(take / "rig.json", "damaged");
  const testing::CommandResult damaged = run("verify -q --manifest check " + quoted);
  EXPECT_EQ(damaged.exit_code, 2);
  EXPECT_THAT(damaged.output, HasSubstr("rig.json: changed"));
  EXPECT_THAT(damaged.output, HasSubstr("archive/c1.mkv: changed"));
}

TEST_F(FixityCommands, OptionsOfManifestsGoTogether) {
  EXPECT_EQ(run("verify -q --manifest check --sign key " + quoted).exit_code, 2);
  EXPECT_EQ(run("verify -q --manifest check --signers file " + quoted).exit_code, 2);
  EXPECT_EQ(run("verify -q --signer name " + quoted).exit_code, 2);
}

TEST_F(FixityCommands, ARottenFrameIsFoundAndPutOnRecord) {
  const std::size_t at = frame_offset(1, 4);
  flip("c1.mkv", at + 3);
  EXPECT_EQ(run("verify -q --depth journal " + quoted).exit_code, 0);
  const auto json_file = folder.path() / "result.json";
  const testing::CommandResult verify =
      run("verify -q --json '" + json_file.string() + "' " + quoted);
  EXPECT_EQ(verify.exit_code, 1) << verify.output;
  EXPECT_THAT(verify.output, HasSubstr("archive/c1.mkv @" + std::to_string(at)));
  EXPECT_THAT(verify.output, HasSubstr("[frame 4 at 0.200000 s]"));
  const auto json = nlohmann::json::parse(read_file(json_file));
  EXPECT_EQ(json["whole"], false);
  EXPECT_EQ(json["cameras"][1]["problems"][0]["offset"], at);
  EXPECT_EQ(json["cameras"][1]["problems"][0]["frames"][0]["time_ns"], 200'000'000);
  EXPECT_THAT(json["cameras"][2]["problems"], IsEmpty());
  EXPECT_EQ(nlohmann::json::parse(run("verify -q --json - " + quoted).output)["depth"], "hashes");

  const auto before = testing::bytes_of(take / "archive/c1.mkv");
  const testing::CommandResult dry = run("repair -q --dry-run " + quoted);
  EXPECT_EQ(dry.exit_code, 3) << dry.output;
  EXPECT_THAT(dry.output, HasSubstr("c1: would be rewritten, 9 frames"));
  EXPECT_EQ(testing::bytes_of(take / "archive/c1.mkv"), before);

  const testing::CommandResult repair = run("repair -q " + quoted);
  EXPECT_EQ(repair.exit_code, 3) << repair.output;
  EXPECT_THAT(repair.output, HasSubstr("frames lost, corrupt: 1"));
  EXPECT_THAT(repair.output, HasSubstr("at 0.200000000 s: a frame is corrupt"));
  EXPECT_THAT(repair.output, HasSubstr("kept as c1.mkv.damaged"));
  EXPECT_EQ(testing::bytes_of(take / "archive/c1.mkv.damaged"), before);
  EXPECT_EQ(run("verify -q " + quoted).exit_code, 0);
  EXPECT_THAT(run("info " + quoted).output, HasSubstr("1 torn"));
}

TEST_F(FixityCommands, LossesOfOneKindAreOneLine) {
  for (std::size_t i = 1; i < 8; ++i) flip("c1.mkv", frame_offset(1, i) + 3);
  const testing::CommandResult repair = run("repair -q " + quoted);
  EXPECT_EQ(repair.exit_code, 3) << repair.output;
  EXPECT_THAT(repair.output, HasSubstr("frames lost, corrupt: 7"));
  EXPECT_THAT(repair.output,
              HasSubstr("at 0.050000000 s, 0.100000000 s, 0.150000000 s, 0.200000000 s and 3 more: "
                        "a frame is corrupt"));
  const std::size_t line = repair.output.find("lost or unverified");
  EXPECT_EQ(repair.output.find("lost or unverified", line + 1), std::string::npos) << repair.output;
}

TEST_F(FixityCommands, RepairIsAdvisedWhereItHelps) {
  ASSERT_EQ(run("sync -q " + quoted).exit_code, 0);
  auto timeline = testing::bytes_of(take / "timeline.zst");
  timeline.at(timeline.size() / 2) ^= std::byte{1};
  testing::overwrite(take / "timeline.zst", timeline);
  testing::CommandResult verify = run("verify -q " + quoted);
  EXPECT_EQ(verify.exit_code, 1);
  EXPECT_THAT(verify.output, HasSubstr("raystage sync"));
  EXPECT_THAT(verify.output, Not(HasSubstr("raystage repair")));

  std::filesystem::remove(take / "timeline.zst");
  std::filesystem::create_directory(take / "recording");
  testing::overwrite(take / "recording/one.json", std::as_bytes(std::span("{}")));
  verify = run("verify -q " + quoted);
  EXPECT_EQ(verify.exit_code, 1);
  EXPECT_THAT(verify.output, HasSubstr("no frame depends on this report"));
  EXPECT_THAT(verify.output, HasSubstr("restore it from a copy"));
  EXPECT_THAT(verify.output, Not(HasSubstr("raystage repair")));

  flip("c1.mkv", frame_offset(1, 4) + 3);
  EXPECT_THAT(run("verify -q " + quoted).output, HasSubstr("`raystage repair"));
}

TEST_F(FixityCommands, WhatIsNoTakeIsCalledThat) {
  for (const char* command : {"verify -q", "repair -q", "info", "sync -q"}) {
    const std::string name = std::string(command) + " '" + take.string();
    EXPECT_THAT(run(name + "/take.json'").output, HasSubstr("this is not a take: it is a file"));
    EXPECT_THAT(run(name + "/archive'").output,
                HasSubstr("this is not a take: it has no take.json"));
    EXPECT_THAT(run(name + "/none'").output,
                HasSubstr("this is not a take: the folder does not exist"));
  }
}

TEST_F(FixityCommands, BadUsageAndInputExitWithTwo) {
  for (const char* command : {"verify", "repair"}) {
    const std::string name(command);
    EXPECT_EQ(run(name).exit_code, 2);
    EXPECT_EQ(run(name + " --nonsense " + quoted).exit_code, 2);
    EXPECT_EQ(run(name + " '" + folder.path().string() + "'").exit_code, 2);
    const testing::CommandResult help = run(name + " --help");
    EXPECT_EQ(help.exit_code, 0);
    EXPECT_THAT(help.output, HasSubstr("default"));
  }
  EXPECT_EQ(run("verify --depth deep " + quoted).exit_code, 2);
  testing::overwrite(take / "take.json", std::as_bytes(std::span("{}")));
  EXPECT_EQ(run("verify -q " + quoted).exit_code, 2);
}

}  // namespace
}  // namespace raystage::cli
