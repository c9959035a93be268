// SPDX-License-Identifier: Apache-2.0
// Tests that a recording with a memory ceiling stays below it whatever a source does, and that the
// other cameras lose no frame.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdio>
#include <nlohmann/json.hpp>

#include "testing/test_folder.h"
#include "testing/test_paths.h"
#include "tests/end_to_end/run_command.h"

namespace raystage {
namespace {

using nlohmann::json;
using testing::CommandResult;
using ::testing::HasSubstr;
using ::testing::Not;
using testing::run;

constexpr double kMegabyte = 1e6;

class RecordCeiling : public ::testing::Test {
 protected:
  void SetUp() override {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "sanitizers take memory of their own";
#endif
  }
  /// Three good cameras, of which the last delivers raw frames, and perhaps a graph that keeps all
  /// of its pictures.
  void configure(const std::string& when_lost, const std::string& hostile) const {
    std::string cameras;
    for (int i = 0; i < 3; ++i) {
      cameras += R"({"id": "good)" + std::to_string(i) +
                 R"(", "simulated": {"rows": 1, "columns": 3, "seconds": 0.5, "jpeg": )" +
                 (i < 2 ? "true" : "false") + R"(, "index": )" + std::to_string(i) + "}},";
    }
    testing::write_text(
        folder_.path() / "record.json",
        R"({"schema": "raystage/record/1", "name": "test", "node": "one", "when_lost": ")" +
            when_lost + R"(", "memory_mb": 40, "cameras": [)" + cameras +
            R"({"id": "hostile", "ffmpeg": {"url": ")" + hostile + R"("}}]})");
  }
  CommandResult record(const std::string& options, const std::string& before = "") const {
    // A source that is not lost would otherwise take all memory of the machine.
    return run("ulimit -v 6000000; cd '" + folder_.path().string() + "' && " + before +
               "raystage record record.json -o take --status none --threads 1 "
               "--allow-filters-with-files " +
               options);
  }
  json session() const {
    return json::parse(testing::read_text(folder_.path() / "take/recording/one.json"))
        .at("sessions")[0];
  }
  void expect_good_cameras_whole(double ceiling_mb) const {
    const json account = session();
    EXPECT_TRUE(account.at("audit").at("passed").get<bool>()) << account.dump(1);
    const double peak = account.at("process_peak_bytes").get<double>() / kMegabyte;
    std::printf("peak %.0f MB below the ceiling of %.0f MB\n", peak, ceiling_mb);
    EXPECT_LT(peak, ceiling_mb);
    EXPECT_GT(peak, 0.8 * ceiling_mb) << "the hostile source took nothing";
    EXPECT_EQ(account.at("memory_ceiling_bytes"), ceiling_mb * kMegabyte);
    for (const json& camera : account.at("cameras")) {
      if (camera.at("id") == "hostile") continue;
      if (camera.at("id") == "good2") {
        expect_raw_camera_accounted(camera);
        continue;
      }
      EXPECT_EQ(camera.at("arrived"), camera.at("stored")) << camera.dump(1);
      // A simulated camera that a busy machine wakes up too late skips a frame, as real ones do.
      EXPECT_LT(camera.at("skipped_by_source").get<double>(),
                0.1 * camera.at("stored").get<double>())
          << camera.dump(1);
      EXPECT_GT(camera.at("stored"), 30) << camera.dump(1);
    }
    EXPECT_EQ(run("cd '" + folder_.path().string() + "' && raystage verify -q take").exit_code, 0);
  }
  /// The JPEG library allocates like other libraries: while the hostile source has all memory that
  /// they may get, a raw frame may be dropped.
  static void expect_raw_camera_accounted(const json& camera) {
    double dropped = 0;
    const json by_reason = camera.value("dropped", json::object());
    for (const json& count : by_reason) dropped += count.get<double>();
    EXPECT_EQ(camera.at("arrived").get<double>(), camera.at("stored").get<double>() + dropped)
        << camera.dump(1);
    EXPECT_GT(camera.at("stored"), 10) << camera.dump(1);
    EXPECT_GT(camera.at("stored").get<double>(), dropped) << camera.dump(1);
  }
  static constexpr const char* kGrowing = "lavfi:testsrc2=size=640x480:rate=30,reverse";

  testing::TestFolder folder_;
};

// Without a ceiling this graph takes all memory of the machine.
TEST_F(RecordCeiling, ASourceThatGrowsWithoutBoundIsLostAndNoOtherFrameIs) {
  configure("continue", kGrowing);
  const CommandResult result = record("--duration 6 --memory-ceiling 560");
  EXPECT_EQ(result.exit_code, 3) << result.err;
  EXPECT_LT(static_cast<double>(result.peak_memory) / kMegabyte, 560);
  expect_good_cameras_whole(560);
  EXPECT_THAT(session().at("cameras")[3].at("events")[0].at("what").get<std::string>(),
              HasSubstr("lost: "));
}

TEST_F(RecordCeiling, AlsoIfItComesBackAgainAndAgain) {
  std::size_t events = 0;
  for (const std::string duration : {"7", "40"}) {  // on a busy machine it comes back later
    configure("reconnect", kGrowing);
    std::filesystem::remove_all(folder_.path() / "take");
    const CommandResult result = record("--duration " + duration + " --memory-ceiling 560");
    EXPECT_EQ(result.exit_code, 3) << result.err;
    expect_good_cameras_whole(560);
    events = session().at("cameras")[3].at("events").size();
    if (events > 3) break;
  }
  EXPECT_GT(events, 3U);
}

// The frames of the good cameras wait in memory meanwhile.
TEST_F(RecordCeiling, AlsoIfTheDiskStalls) {
  configure("reconnect", kGrowing);
  const CommandResult result =
      record("--duration 7 --memory-ceiling 560",
             "export BAD_DISK_FOLDER=\"$PWD/take\" BAD_DISK='STALL 300000 2' && "
             "LD_PRELOAD='" +
                 testing::disk_faults_library().string() + "' ");
  EXPECT_EQ(result.exit_code, 3) << result.err;
  expect_good_cameras_whole(560);
  EXPECT_GT(session().at("memory_peak_bytes"), 500'000) << "the disk did not stall";
}

TEST_F(RecordCeiling, TooLowOnesAreRefusedBeforeAnythingIsWritten) {
  configure("continue", "lavfi:testsrc2=size=640x480:rate=30");
  const CommandResult result = record("--duration 1 --memory-ceiling 100");
  EXPECT_EQ(result.exit_code, 2) << result.err;
  EXPECT_THAT(result.err, HasSubstr("a ceiling of 100 MB leaves"));
  EXPECT_FALSE(std::filesystem::exists(folder_.path() / "take"));
}

// Embree, which renders them, may hang when an allocation fails.
TEST_F(RecordCeiling, DoesNotHoldWhileSimulatedCamerasAreRendered) {
  std::string cameras;
  for (int i = 0; i < 8; ++i) {
    cameras += std::string(i > 0 ? "," : "") + R"({"id": "c)" + std::to_string(i) +
               R"(", "simulated": {"rows": 1, "columns": 1, "seconds": 0.1, "width": 64, )" +
               R"("height": 48, "seed": )" + std::to_string(i + 1) + "}}";
  }
  testing::write_text(folder_.path() / "record.json",
                      R"({"schema": "raystage/record/1", "name": "test", "node": "one", )"
                      R"("memory_mb": 40, "cameras": [)" +
                          cameras + "]}");
  const CommandResult result = record("--duration 1 --memory-ceiling 100");
  EXPECT_EQ(result.exit_code, 2) << result.err;
  EXPECT_THAT(result.err, HasSubstr("a ceiling of 100 MB leaves"));
  EXPECT_THAT(result.err, Not(HasSubstr("ABSENT")));
  EXPECT_GT(result.peak_memory, 256'000'000U) << "they need less than the least ceiling";
}

}  // namespace
}  // namespace raystage
