// SPDX-License-Identifier: Apache-2.0
// Tests a node that records, is stopped, killed and resumed; its parts are joined, verified and
// resynchronised.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <sstream>

#include "schemas/recording_document.h"
#include "testing/test_folder.h"
#include "tests/end_to_end/run_command.h"

namespace raystage {
namespace {

using nlohmann::json;
using testing::CommandResult;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::run;
using testing::write_text;

class Record : public ::testing::Test {
 protected:
  Record() {
    write_text(folder_.path() / "record.json", R"({"schema": "raystage/record/1", "name": "test",
      "node": "one", "memory_mb": 50, "cameras": [
      {"id": "a", "ffmpeg": {"url": "testsrc=size=96x64:rate=30,realtime", "format": "lavfi"}},
      {"id": "b", "simulated": {"index": 1, "rows": 1, "columns": 2, "width": 64, "height": 48,
                                "seconds": 0.3, "jpeg": true}}]})");
    write_text(folder_.path() / "other.json", R"({"schema": "raystage/record/1", "name": "test",
      "node": "two", "memory_mb": 50, "cameras": [
      {"id": "c", "ffmpeg": {"url": "lavfi:testsrc2=size=96x64:rate=30,realtime"}}]})");
  }
  CommandResult here(const std::string& command) const {
    return run("cd '" + folder_.path().string() + "' && " + command);
  }
  json account(const std::string& name) const {
    return json::parse(testing::read_text(folder_.path() / name));
  }
  const std::filesystem::path& folder() const { return folder_.path(); }

 private:
  testing::TestFolder folder_;
};

TEST_F(Record, TwoNodesBecomeOneTake) {
  const CommandResult first = here("raystage record record.json -o one --duration 1 --quiet");
  ASSERT_EQ(first.exit_code, 0) << first.err;
  EXPECT_THAT(first.err, Not(HasSubstr("opening 2 cameras")));
  EXPECT_THAT(first.out, HasSubstr("The audit passed."));
  ASSERT_EQ(here("raystage record other.json -o two --duration 0.5 --status none").exit_code, 0);
  const CommandResult joined = here("raystage join one two -o take -q");
  ASSERT_EQ(joined.exit_code, 0) << joined.err;
  EXPECT_THAT(joined.out, HasSubstr("3 cameras of 2 parts"));
  EXPECT_THAT(joined.err, HasSubstr("the parts do not overlap in time: one from "));
  EXPECT_THAT(here("raystage info take").out, HasSubstr("the rig is not calibrated"));
  EXPECT_EQ(here("raystage verify -q --decode take").exit_code, 0);
  const json info = json::parse(here("raystage info --json take").out);
  EXPECT_GT(info.at("cameras")[0].at("frames").get<int>(), 20);
  EXPECT_EQ(info.at("cameras").size(), 3U);
  EXPECT_EQ(here("raystage sync take --fps 15").exit_code, 0);
  EXPECT_EQ(here("raystage join one one -o twice").exit_code, 2);
}

TEST_F(Record, CtrlCIsTheProperEndAndStatusIsForPrograms) {
  const CommandResult result = here(
      "{ raystage record record.json -o take --status json & pid=$!; "
      "while [ ! -e take/take.json ]; do sleep 0.05; done; sleep 2.2; kill -INT $pid; "
      "wait $pid; }");
  EXPECT_EQ(result.exit_code, 0) << result.err;
  std::istringstream lines(result.out);
  int count = 0;
  for (std::string line; std::getline(lines, line); ++count) {
    const json status = json::parse(line);
    EXPECT_EQ(status.at("cameras").size(), 2U);
    EXPECT_LE(status.at("memory_used_bytes"), status.at("memory_limit_bytes"));
  }
  EXPECT_GE(count, 2);
  const json session = account("take/recording/one.json").at("sessions").at(0);
  EXPECT_EQ(session.at("stop_reason"), "stopped as asked");
  EXPECT_TRUE(session.at("audit").at("passed").get<bool>());
}

TEST_F(Record, AKilledRecordingOpensAndIsGoneOnWith) {
  const CommandResult killed = here(
      "{ raystage record record.json -o take --status none & pid=$!; "
      "while [ ! -e take/take.json ]; do sleep 0.05; done; sleep 1; kill -KILL $pid; "
      "wait $pid; }");
  EXPECT_EQ(killed.exit_code, 137);
  EXPECT_THAT(here("raystage info take").out, HasSubstr("not closed"));
  const CommandResult verify = here("raystage verify -q take");
  EXPECT_EQ(verify.exit_code, 1);
  EXPECT_THAT(verify.out, HasSubstr("--resume -o take` continues the recording"));
  EXPECT_THAT(verify.out, HasSubstr("`raystage repair take` closes it"));
  EXPECT_EQ(here("raystage record record.json -o take --status none --duration 0.3").exit_code, 2);
  const CommandResult resumed =
      here("raystage record record.json -o take --resume --duration 0.5 --status none");
  EXPECT_EQ(resumed.exit_code, 0) << resumed.err;
  EXPECT_EQ(account("take/recording/one.json").at("sessions").size(), 2U);
  EXPECT_EQ(here("raystage verify -q take").exit_code, 0);
  EXPECT_THAT(here("raystage info take").out, HasSubstr("Resumed     at "));
  const json sync = json::parse(here("raystage sync take --json -q").out);
  EXPECT_EQ(sync.at("pauses").size(), 1U);
  EXPECT_TRUE(sync.at("clock_steps").empty());
  for (const json& camera : sync.at("cameras")) {
    EXPECT_TRUE(camera.at("own_jumps").empty());
    // On a slow machine there may be too few frames to check.
    if (camera.at("rate_hz").is_null()) continue;
    EXPECT_NEAR(camera.at("rate_hz").get<double>(), camera.at("id") == "a" ? 30 : 15, 0.2);
  }
}

TEST_F(Record, ResumingWritesNothingBehindLinks) {
  ASSERT_EQ(here("raystage record record.json -o take --status none --duration 0.5").exit_code, 0);
  const CommandResult info = here("raystage info take --json");
  const std::string resume =
      "raystage record record.json -o take --resume --status none --duration 0.3";
  for (const std::string name : {".reserve", "recording", "archive/b.mkv", "archive/b.journal"}) {
    ASSERT_EQ(here("mkdir -p victim && rm -rf victim/* && echo kept > victim/file && "
                   "if [ -e take/" +
                   name + " ]; then mv take/" + name +
                   " aside; fi; "
                   "ln -s \"$PWD\"/victim/" +
                   (name == "recording" ? "" : "file") + " take/" + name)
                  .exit_code,
              0);
    const CommandResult resumed = here(resume);
    EXPECT_EQ(resumed.exit_code, 2) << name << resumed.err;
    EXPECT_EQ(here("cat victim/file; ls -A victim | wc -l").out, "kept\n1\n") << name;
    ASSERT_EQ(here("rm take/" + name + "; if [ -e aside ]; then mv aside take/" + name + "; fi")
                  .exit_code,
              0);
  }
  EXPECT_EQ(here("raystage info take --json").out, info.out);
  EXPECT_EQ(here(resume).exit_code, 0);
}

TEST_F(Record, PipesAndDevicesInTheTakeDoNotHang) {
  ASSERT_EQ(here("raystage record record.json -o take --status none --duration 0.5").exit_code, 0);
  // Sanitizers need more address space than they use.
  std::string limit = "ulimit -v 4000000; ";
  if (here(limit + "raystage verify -q take").exit_code != 0) limit = "";
  for (const char* command : {"info", "verify -q", "sync -q", "repair -q"}) {
    ASSERT_EQ(here(limit + "timeout 60 raystage " + command + " take").exit_code, 0) << command;
  }
  for (const char* name : {"take.json", "rig.json", "archive/b.mkv", "archive/b.journal"}) {
    for (const char* special : {"mkfifo take/", "ln -s /dev/zero take/"}) {
      ASSERT_EQ(here(std::string("mv take/") + name + " aside && " + special + name).exit_code, 0);
      for (const char* command : {"info", "verify -q", "sync -q", "repair -q"}) {
        const CommandResult result = here(limit + "timeout 20 raystage " + command + " take");
        EXPECT_TRUE(result.exit_code == 1 || result.exit_code == 2)
            << special << name << " " << command << ": " << result.exit_code << result.err;
      }
      ASSERT_EQ(here(std::string("rm take/") + name + " && mv aside take/" + name).exit_code, 0);
    }
  }
  EXPECT_EQ(here("raystage verify -q take").exit_code, 0);
}

TEST_F(Record, ACameraThatCannotBeOpenedIsReportedAndTheOthersAreRecorded) {
  write_text(folder() / "record.json", R"({"schema": "raystage/record/1", "name": "test",
      "node": "one", "memory_mb": 50, "cameras": [
      {"id": "a", "ffmpeg": {"url": "lavfi:testsrc=size=96x64:rate=30,realtime"}},
      {"id": "b", "ffmpeg": {"url": "tcp://127.0.0.1:1"}}]})");
  const CommandResult result = here("raystage record record.json -o take --duration 1 -q");
  EXPECT_EQ(result.exit_code, 3) << result.err;
  EXPECT_THAT(result.err, HasSubstr("camera \"b\" is ABSENT, the others are recorded: "));
  const json cameras = account("take/recording/one.json").at("sessions")[0].at("cameras");
  EXPECT_GT(cameras[0].at("stored").get<int>(), 20);
  EXPECT_EQ(here("raystage verify -q --decode take").exit_code, 0);
  EXPECT_EQ(here("raystage info take").exit_code, 0);
}

TEST_F(Record, FoldersAboveATakeAreMade) {
  for (const char* command :
       {"record other.json --duration 0.5 --status none -o a/one",
        "record record.json --duration 0.5 --status none -o a/b/two",
        "join -q a/one a/b/two -o c/d/take", "sync -q c/d/take -o e/f/take"}) {
    const CommandResult made = here(std::string("raystage ") + command);
    EXPECT_EQ(made.exit_code, 0) << made.err;
  }
  EXPECT_EQ(here("raystage verify -q e/f/take").exit_code, 0);
}

TEST_F(Record, OnlyATakeCanBeGoneOnWith) {
  const CommandResult resumed = here("raystage record other.json -o none --resume --status none");
  EXPECT_EQ(resumed.exit_code, 2);
  EXPECT_THAT(resumed.err, HasSubstr("none: there is no take to resume. Omit --resume"));
  EXPECT_FALSE(std::filesystem::exists(folder() / "none"));
}

TEST_F(Record, ATimeThatHasPassedIsNoStart) {
  const CommandResult past = here(
      "raystage record other.json -o take --start-at $(date -u -d '-1 hour' +%FT%TZ) --status "
      "none");
  EXPECT_EQ(past.exit_code, 2) << past.err;
  EXPECT_THAT(past.err, HasSubstr("--start-at"));
  EXPECT_FALSE(std::filesystem::exists(folder() / "take"));
  // A busy machine may delay it by seconds.
  const CommandResult late = here(
      "raystage record other.json -o take --start-at $(date -u -d '-3 seconds' +%FT%TZ) "
      "--duration 9 --status none");
  EXPECT_EQ(late.exit_code, 0) << late.err;
  EXPECT_THAT(late.err, HasSubstr("s ago"));
  EXPECT_THAT(late.out, HasSubstr("s after --start-at: "));
  const schemas::RecordingDocument account =
      schemas::read_recording(folder() / "take/recording/two.json");
  EXPECT_GE(account.sessions.at(0).late(), 3 * kNanosecondsPerSecond);
  EXPECT_THAT(here("raystage info take").out, HasSubstr("after its --start-at"));
}

TEST_F(Record, OneMayGoOnOnlyWithinTheTakesTimes) {
  const CommandResult first = here(
      "raystage record other.json -o take --start-at $(date -u -d '+2 seconds' +%FT%TZ) "
      "--duration 0.2 --status none");
  EXPECT_EQ(first.exit_code, 0) << first.err;
  EXPECT_THAT(first.err, HasSubstr("Recording starts at"));
  EXPECT_THAT(first.out, Not(HasSubstr("s after --start-at")));
  const auto before = testing::read_folder(folder() / "take");
  const CommandResult far = here(
      "raystage record other.json -o take --resume --start-at "
      "$(date -u -d '+200 days' +%FT%TZ) --status none");
  EXPECT_EQ(far.exit_code, 2) << far.err;
  EXPECT_THAT(far.err, HasSubstr("104 days"));
  const CommandResult early = here(
      "raystage record other.json -o take --resume --start-at "
      "$(date -u -d '-30 seconds' +%FT%TZ) --status none");
  EXPECT_EQ(early.exit_code, 2) << early.err;
  EXPECT_THAT(early.err, HasSubstr("before the take's epoch"));
  EXPECT_EQ(testing::read_folder(folder() / "take"), before);
}

TEST_F(Record, HoldSaysHowLongTheMemoryLasts) {
  const CommandResult held =
      here("raystage record other.json -o take --buffer-in-memory --duration 1 --status none");
  EXPECT_EQ(held.exit_code, 0) << held.err;
  // The rest of the 50 MB is for frames being encoded and for records of missing frames.
  EXPECT_THAT(held.err, HasSubstr("48 MB of memory hold"));
  EXPECT_EQ(here("raystage verify -q take").exit_code, 0);
}

/// Sources with an end that are read on demand: a file, an image sequence, a filter graph, a pipe.
class RecordFinite : public Record {
 protected:
  void SetUp() override {
    if (std::system("ffmpeg -version > /dev/null 2>&1") != 0) GTEST_SKIP() << "there is no ffmpeg";
    ASSERT_EQ(here("ffmpeg -v error -f lavfi -i testsrc=size=96x64:rate=25 -frames:v 50 "
                   "-c:v mpeg4 movie.mkv -frames:v 30 %03d.jpg")
                  .exit_code,
              0);
    configure("movie", R"({"url": "movie.mkv"})");
    configure("images", R"({"url": "%03d.jpg"})");
    configure("graph", R"({"url": "lavfi:testsrc=size=96x64:rate=25:duration=2"})");
    configure("pipe", R"({"url": "pipe:0", "format": "rawvideo", "options": {
              "pixel_format": "yuvj420p", "video_size": "32x24", "framerate": "50"}})");
  }
  /// Records with `piped` raw frames on standard input.
  CommandResult record(const std::string& name, const std::string& options, int piped = 20) const {
    constexpr int kRawBytes = 32 * 24 * 3 / 2;
    return here("head -c " + std::to_string(piped * kRawBytes) + " /dev/zero | raystage record " +
                name + ".json -o " + name + " --status none " + options);
  }

 private:
  void configure(const std::string& name, const std::string& source) const {
    write_text(folder() / (name + ".json"),
               R"({"schema": "raystage/record/1", "name": "test", "node": "one", "memory_mb": 50,
               "cameras": [{"id": "a", "ffmpeg": )" +
                   source + "}]}");
  }
};

TEST_F(RecordFinite, EveryFrameIsStored) {
  for (const std::string hold : {"", "--buffer-in-memory"}) {
    for (const auto& [name, frames] : {std::pair{"movie", "50"}, std::pair{"images", "30"},
                                       std::pair{"graph", "50"}, std::pair{"pipe", "20"}}) {
      const CommandResult result = record(name, hold);
      EXPECT_EQ(result.exit_code, 0) << result.err;
      EXPECT_THAT(result.out,
                  HasSubstr(std::string(frames) + " frames received = " + frames + " stored"))
          << name << hold;
      const json camera =
          account(std::string(name) + "/recording/one.json").at("sessions")[0].at("cameras")[0];
      EXPECT_EQ(camera.value("corrected_timestamps", 0), 0) << name;
      EXPECT_EQ(result.err.find("is unknown") == std::string::npos, hold.empty()) << result.err;
      std::filesystem::remove_all(folder() / name);
    }
  }
}

TEST_F(RecordFinite, ACameraWithoutAFrameIsNoSuccess) {
  const CommandResult result = record("pipe", "", 0);
  EXPECT_EQ(result.exit_code, 3) << result.err;
  EXPECT_THAT(result.out, HasSubstr("sent no frame"));
}

}  // namespace
}  // namespace raystage
