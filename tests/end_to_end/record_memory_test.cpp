// SPDX-License-Identifier: Apache-2.0
// Tests that a recording needs no more RAM than it states at its start.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <cstdio>
#include <nlohmann/json.hpp>
#include <regex>

#include "base/resources.h"
#include "testing/test_folder.h"
#include "tests/end_to_end/run_command.h"

namespace raystage {
namespace {

using nlohmann::json;
using testing::CommandResult;
using ::testing::HasSubstr;
using testing::run;
using testing::write_text;

class RecordMemory : public ::testing::Test {
 protected:
  void configure(const std::string& cameras) const {
    write_text(folder_.path() / "record.json", R"({"schema": "raystage/record/1", "name": "test",
      "node": "one", "cameras": [)" + cameras + "]}");
  }
  CommandResult record(const std::string& options) const {
    return run("cd '" + folder_.path().string() +
               "' && raystage record record.json -o take --status none " + options);
  }
  json session() const {
    return json::parse(testing::read_text(folder_.path() / "take/recording/one.json"))
        .at("sessions")[0];
  }
  /// Returns the MB in the line at the start.
  static double said(const std::string& err, const std::string& pattern) {
    std::smatch found;
    return std::regex_search(err, found, std::regex(pattern)) ? std::stod(found[1]) : -1;
  }
  /// Returns a source that repeats three noisy pictures for 8 s: fast to deliver, slow to encode,
  /// so that frames wait in memory on a loaded machine, too.
  static std::string graph(const std::string& id) {
    return R"({"id": ")" + id + R"(", "ffmpeg": {"url": "lavfi:testsrc2=size=640x480:rate=30)" +
           R"(:duration=0.1,noise=alls=60:allf=t,loop=loop=79:size=3"}})";
  }
  static std::string simulated(const std::string& id, int index) {
    return R"({"id": ")" + id +
           R"(", "simulated": {"rows": 1, "columns": 2, "seconds": 1, "index": )" +
           std::to_string(index) + "}}";
  }
  const std::filesystem::path& folder() const { return folder_.path(); }

  /// Expects that a recording with `--memory 100` needed most, but not more, of the stated memory.
  void expect_within(const CommandResult& result) const {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "sanitizers take memory of their own";
#endif
    constexpr double kLimit = 100, kBytesPerMb = 1e6;
    ASSERT_NE(result.exit_code, 2) << result.err;
    EXPECT_EQ(said(result.err, "RAM: (\\d+) MB for frames"), kLimit) << result.err;
    const double all = kLimit + said(result.err, "plus up to about (\\d+) MB");
    const double peak = static_cast<double>(result.peak_memory) / kBytesPerMb;
    std::printf("peak %.0f MB of %.0f MB stated\n", peak, all);
    EXPECT_LE(peak, all);
    EXPECT_GT(peak, 0.5 * all) << "the stated memory is far above the peak";
    EXPECT_GT(session().at("memory_peak_bytes").get<double>() / kBytesPerMb, 0.8 * kLimit);
  }

 private:
  testing::TestFolder folder_;
};

// Filter graphs deliver more frames than one thread encodes.
TEST_F(RecordMemory, StaysWithinWhatItSays) {
  configure(graph("a") + "," + graph("b") + "," + graph("c"));
  expect_within(record("--memory 100 --threads 1"));
}

// Simulated cameras also keep the pictures that they render in advance in memory.
TEST_F(RecordMemory, StaysWithinWhatItSaysOfASimulation) {
  configure(graph("a") + "," + graph("b") + "," + graph("c") + "," + simulated("d", 0) + "," +
            simulated("e", 1));
  expect_within(record("--memory 100 --threads 1 --duration 4"));
}

TEST_F(RecordMemory, AFiniteGraphWaitsForRoomAsAFileDoes) {
  configure(graph("a"));
  const CommandResult result = record("--memory 6 --threads 1");
  EXPECT_EQ(result.exit_code, 0) << result.err;
  EXPECT_THAT(result.out, HasSubstr("every source has ended"));
  EXPECT_THAT(result.out, HasSubstr("240 frames received = 240 stored"));
}

TEST_F(RecordMemory, MoreThanTheMachineHasIsRefused) {
  configure(simulated("a", 0));
  const double machine = static_cast<double>(available_memory()) / 1e6;
  const CommandResult result = record("--memory " + std::to_string(machine + 1000));
  EXPECT_EQ(result.exit_code, 2) << result.err;
  for (const double megabytes : {machine, machine + 1000}) {
    EXPECT_THAT(result.err, HasSubstr(std::to_string(std::lround(megabytes)) + " MB"));
  }
  EXPECT_FALSE(std::filesystem::exists(folder() / "take"));
  const CommandResult nearly =
      record("--memory " + std::to_string(machine - 1) + " --duration 0.1");
  EXPECT_NE(nearly.exit_code, 2) << nearly.err;
  EXPECT_THAT(nearly.err, HasSubstr("more than 80 %"));
}

}  // namespace
}  // namespace raystage
