// SPDX-License-Identifier: Apache-2.0
// raystage verify and raystage repair as an archivist runs them.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <sys/wait.h>

#include <chrono>
#include <csignal>
#include <nlohmann/json.hpp>
#include <random>
#include <thread>

#include "base/atomic_file.h"
#include "testing/cli/running_command.h"
#include "testing/cli/test_command.h"
#include "testing/store/sparse_take.h"
#include "testing/store/take_test_data.h"
#include "testing/test_folder.h"
#include "testing/test_permissions.h"

namespace raystage::cli {
namespace {

using ::testing::HasSubstr;
using ::testing::IsEmpty;
using ::testing::Not;
using ::testing::StartsWith;

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

TEST_F(FixityCommands, ACatalogueWithoutTakesIsAProblem) {
  create_folder(folder.path() / "not mounted");
  const testing::CommandResult result =
      run("verify -q --catalogue '" + (folder.path() / "not mounted").string() + "'");
  EXPECT_EQ(result.exit_code, 1);
  EXPECT_THAT(result.output, HasSubstr("no take was found, as if a disk were not mounted"));
}

TEST_F(FixityCommands, AnEventSaysThatTheManifestDiffers) {
  ASSERT_EQ(run("verify -q --manifest write " + quoted).exit_code, 0);
  write_file_atomically(take / "added.txt", "x");
  EXPECT_EQ(run("verify -q --manifest check " + quoted).exit_code, 1);
  const std::string events = read_file(take / "events.jsonl");
  EXPECT_THAT(events, HasSubstr("3 of 3 cameras intact; files or the signature are not as"));
}

TEST_F(FixityCommands, AnIntactTakeNeedNotBeWritable) {
  namespace fs = std::filesystem;
  for (const auto& entry : fs::recursive_directory_iterator(folder.path())) {
    fs::permissions(entry, fs::perms::others_read | fs::perms::others_exec, fs::perm_options::add);
  }
  fs::permissions(folder.path(), fs::perms(0755));
  const std::string result = testing::run_unprivileged([&] {
    const testing::CommandResult repaired = run("repair -q " + quoted);
    return fmt::format("{} {}", repaired.exit_code, repaired.output);
  });
  if (result.starts_with("126") || result.starts_with("127")) GTEST_SKIP() << result;
  EXPECT_THAT(result, StartsWith("0 "));
  EXPECT_THAT(result, HasSubstr("3 of 3 cameras were intact"));
}

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

/// A link to itself, and a name that no file can have, are faults of one camera.
TEST_F(FixityCommands, WhatCannotBeExaminedIsAnErrorOfItsCamera) {
  const auto expect_named = [&](const std::string& command, const std::string& name) {
    const testing::CommandResult result = run(command + " " + quoted);
    EXPECT_THAT(result.output, HasSubstr(name)) << command;
    for (const char* wrong : {"unexpected", "Please report", "free space"}) {
      EXPECT_THAT(result.output, Not(HasSubstr(wrong))) << command;
    }
    return result;
  };
  const auto journal = take / "archive/c1.journal";
  const std::string journal_text = read_file(journal), document = read_file(take / "take.json");
  std::filesystem::remove(journal);
  std::filesystem::create_symlink("c1.journal", journal);
  EXPECT_EQ(expect_named("verify -q", "c1.journal").exit_code, 2);
  EXPECT_THAT(expect_named("verify -q", "c1.journal").output, HasSubstr("2 intact"));
  EXPECT_THAT(expect_named("repair -q", "c1.journal").output, HasSubstr("2 of 3 cameras"));
  EXPECT_EQ(expect_named("info", "c1.journal").exit_code, 2);
  std::filesystem::remove(journal);
  write_file_atomically(journal, journal_text);

  std::filesystem::create_symlink("timeline.zst", take / "timeline.zst");
  EXPECT_EQ(expect_named("verify -q", "timeline.zst").exit_code, 1);
  EXPECT_EQ(expect_named("info", "Timeline    a part of the path is a link").exit_code, 0);
  std::filesystem::remove(take / "timeline.zst");

  const std::string long_name = std::string(300, 'x') + ".mkv";
  std::string text = document;
  const std::size_t at = text.find("c1.mkv");
  ASSERT_NE(at, std::string::npos);
  write_file_atomically(take / "take.json", text.replace(at, 6, long_name));
  EXPECT_EQ(expect_named("verify -q", long_name).exit_code, 2);
  EXPECT_THAT(expect_named("repair -q --dry-run", long_name).output, HasSubstr("2 of 3 cameras"));
}

TEST_F(FixityCommands, JsonHoldsNamesThatAreNotUtf8) {
  const auto renamed = folder.path() / "take\xFF";
  std::filesystem::rename(take, renamed);
  for (const char* command : {"verify -q --json - ", "info --json "}) {
    const testing::CommandResult result = run(command + ("'" + renamed.string() + "'"));
    EXPECT_EQ(result.exit_code, 0) << result.output;
    EXPECT_TRUE(nlohmann::json::accept(result.output)) << result.output;
  }
}

/// A name must not look like a line of a report.
TEST_F(FixityCommands, ANameHasNoLines) {
  std::string text = read_file(take / "take.json");
  const std::size_t at = text.find("\"test\"");
  ASSERT_NE(at, std::string::npos);
  write_file_atomically(take / "take.json",
                        text.replace(at, 6, "\"test\\nEvery frame is intact\""));
  const testing::CommandResult info = run("info " + quoted);
  EXPECT_THAT(info.output, HasSubstr("test\\u000aEvery frame is intact"));
  EXPECT_THAT(info.output, Not(HasSubstr("\nEvery frame is intact")));
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
  // What the earlier manifest states is not lost.
  const std::string before = read_file(take / "manifest.sha256");
  const testing::CommandResult other = run("verify -q --manifest write " + quoted);
  EXPECT_EQ(other.exit_code, 2) << other.output;
  EXPECT_THAT(other.output, HasSubstr("another manifest already"));
  EXPECT_EQ(read_file(take / "manifest.sha256"), before);

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
  EXPECT_EQ(run("verify -q --depth sizes --manifest write " + quoted).exit_code, 2);
  EXPECT_FALSE(file_exists(take / "manifest.sha256"));
}

TEST_F(FixityCommands, AKeyThatFailsCostsNeitherManifestNorSignature) {
  EXPECT_EQ(run("verify -q --manifest write " + quoted).exit_code, 0);
  write_file_atomically(take / "manifest.sha256.sig", "an earlier signature");
  const std::string before = read_file(take / "manifest.sha256");
  const testing::CommandResult failed =
      run("verify -q --manifest write --sign /nonexistent/key " + quoted);
  EXPECT_EQ(failed.exit_code, 1) << failed.output;
  EXPECT_EQ(read_file(take / "manifest.sha256"), before);
  EXPECT_EQ(read_file(take / "manifest.sha256.sig"), "an earlier signature");
  EXPECT_FALSE(file_exists(take / ".manifest.sha256.signing"));
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

/// Runs `raystage repair` and kills it when it has begun to write. Returns false if it ended
/// before.
bool repair_is_killed(const std::filesystem::path& take) {
  testing::RunningCommand repair({"raystage-repair", take.string()});
  const auto has_begun = [&] {
    std::error_code error;
    for (std::filesystem::directory_iterator entry(take / "archive", error), end;
         !error && entry != end; entry.increment(error)) {
      if (entry->path().filename().string().starts_with(".")) return true;
    }
    return false;
  };
  while (!repair.has_ended()) {
    if (has_begun()) return WIFSIGNALED(repair.end_by(SIGKILL));
  }
  return false;
}

TEST_F(FixityCommands, ARepairThatWasKilledLeavesNothingHiddenAfterTheNext) {
  // Large enough that the repair is killed in the middle.
  const std::filesystem::path large = folder.path() / "large";
  std::vector<std::vector<Nanoseconds>> times(2);
  for (auto& column : times) {
    for (int i = 0; i < 30'000; ++i) column.push_back(Nanoseconds{i} * 50'000'000);
  }
  testing::write_take(large, times, 20);
  for (const char* name : {"c0.mkv", "c1.mkv"}) {
    auto bytes = testing::bytes_of(large / "archive" / name);
    bytes.at(bytes.size() / 2) ^= std::byte{1};
    testing::overwrite(large / "archive" / name, bytes);
  }
  ASSERT_TRUE(repair_is_killed(large));
  const auto hidden = [&] {
    std::vector<std::string> names;
    for (const auto& entry : std::filesystem::recursive_directory_iterator(large)) {
      const std::string name = entry.path().filename().string();
      if (name.starts_with(".")) names.push_back(name);
    }
    return names;
  };
  EXPECT_THAT(hidden(), Not(IsEmpty()));
  const testing::CommandResult repair = run("repair -q '" + large.string() + "'");
  EXPECT_THAT(hidden(), IsEmpty()) << repair.output;
  EXPECT_EQ(run("verify -q '" + large.string() + "'").exit_code, 0);
}

TEST_F(FixityCommands, TruncationMeanwhileIsAnErrorThatNamesTheFile) {
  const std::filesystem::path large = folder.path() / "large";
  std::vector<std::vector<Nanoseconds>> times(1);
  for (int i = 0; i < 60'000; ++i) times[0].push_back(Nanoseconds{i} * 50'000'000);
  testing::write_take(large, times, 20);
  const std::filesystem::path archive = large / "archive" / "c0.mkv";
  const auto whole = testing::bytes_of(archive);
  const auto journal = testing::bytes_of(large / "archive" / "c0.journal");
  std::mt19937 random(3);
  for (const char* command : {"verify -q ", "repair -q ", "info ", "sync -q "}) {
    SCOPED_TRACE(command);
    const std::string line = command + ("'" + large.string() + "'");
    testing::overwrite(archive, whole);
    const auto start = std::chrono::steady_clock::now();
    EXPECT_EQ(run(line).exit_code, 0);
    const auto duration = std::chrono::steady_clock::now() - start;
    for (int i = 0; i < 8; ++i) {
      testing::overwrite(archive, whole);
      std::thread other([&, part = std::uniform_real_distribution<double>(0.2, 1)(random)] {
        std::this_thread::sleep_for(duration * part);
        EXPECT_EQ(truncate(archive.c_str(), 5000), 0);
      });
      const testing::CommandResult result = run(line);
      other.join();
      EXPECT_GE(result.exit_code, 0) << "a signal";
      EXPECT_LE(result.exit_code, 4) << result.output;
      if (result.exit_code != 0) {
        EXPECT_THAT(result.output, HasSubstr("c0."));
      }
      testing::overwrite(large / "archive" / "c0.journal", journal);
    }
  }
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

TEST_F(FixityCommands, FramesOfALostJournalStayUnverified) {
  std::filesystem::remove(take / "archive" / "c1.journal");
  EXPECT_EQ(run("repair -q " + quoted).exit_code, 3);
  for (const char* depth : {"", "--depth journal "}) {
    const testing::CommandResult verify = run("verify -q " + std::string(depth) + quoted);
    EXPECT_EQ(verify.exit_code, 0) << verify.output;
    EXPECT_THAT(verify.output, HasSubstr("3 cameras: 3 intact"));
    EXPECT_THAT(verify.output, HasSubstr("c1: 10 frames are unverified: their records were lost"));
  }
  const auto json = nlohmann::json::parse(run("verify -q --json - " + quoted).output);
  EXPECT_EQ(json["cameras"][0]["unverified_frames"], 0);
  EXPECT_EQ(json["cameras"][1]["unverified_frames"], 10);
  EXPECT_THAT(run("info " + quoted).output, HasSubstr("10 frames are unverified"));
  EXPECT_EQ(
      nlohmann::json::parse(run("info --json " + quoted).output)["cameras"][1]["unverified_frames"],
      10);
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

/// Starts `raystage verify --catalogue` with a slow pace and kills it when the catalogue states
/// progress.
void kill_catalogue_run(const std::filesystem::path& takes) {
  testing::RunningCommand verify(
      {"raystage-verify", "--catalogue", takes.string(), "--limit-mbps", "0.4", "-q", "-j", "1"});
  const std::filesystem::path catalogue = takes / "raystage-fixity.json";
  for (int i = 0; i < 600; ++i) {
    std::this_thread::sleep_for(std::chrono::milliseconds(50));
    if (std::filesystem::exists(catalogue) &&
        read_file(catalogue).find("\"frames\"") != std::string::npos) {
      break;
    }
  }
  EXPECT_EQ(testing::run_raystage("verify -q --catalogue '" + takes.string() + "'").exit_code, 1)
      << "two runs used one catalogue";
  ASSERT_TRUE(WIFSIGNALED(verify.end_by(SIGKILL)));
}

TEST_F(FixityCommands, ACatalogueOfManyTakes) {
  const std::filesystem::path takes = folder.path() / "takes";
  testing::write_sparse_take(takes / "long", 800, 10'000);
  kill_catalogue_run(takes);
  const auto interrupted = nlohmann::json::parse(read_file(takes / "raystage-fixity.json"));
  const auto& camera = interrupted["takes"][0]["progress"]["cameras"][0];
  EXPECT_GT(camera["frames"], 0);
  EXPECT_LT(camera["frames"], 800);
  EXPECT_FALSE(interrupted["takes"][0].contains("last_check"));

  testing::write_sparse_take(takes / "short", 2, 1000);
  const std::string arguments = "verify -q --catalogue '" + takes.string() + "' ";
  const testing::CommandResult first = run(arguments);
  EXPECT_EQ(first.exit_code, 0) << first.output;
  EXPECT_THAT(first.output,
              HasSubstr("2 takes: 2 intact, 0 not yet checked, 0 due; 2 checked now"));
  const auto second = nlohmann::json::parse(run(arguments + "--json -").output);
  EXPECT_TRUE(second["good"]);
  EXPECT_EQ(second["takes"].size(), 2U);
  EXPECT_FALSE(second["takes"][1]["checked_now"]);
  EXPECT_FALSE(second["takes"][1]["due"]);

  std::filesystem::remove_all(takes / "short");
  const testing::CommandResult missing = run(arguments + "--report");
  EXPECT_EQ(missing.exit_code, 1);
  EXPECT_THAT(missing.output, HasSubstr("short: missing since"));
  EXPECT_EQ(run(arguments + "--forget-missing").exit_code, 0);
  EXPECT_EQ(run(arguments + "--depth sizes").exit_code, 2);
  EXPECT_EQ(run(arguments + quoted).exit_code, 2);
  EXPECT_EQ(run("verify").exit_code, 2);
  EXPECT_EQ(run("verify --catalogue '" + (folder.path() / "none").string() + "'").exit_code, 2);
}

}  // namespace
}  // namespace raystage::cli
