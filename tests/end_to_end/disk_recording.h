// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <gtest/gtest.h>

#include <algorithm>
#include <filesystem>
#include <nlohmann/json.hpp>
#include <sstream>
#include <string>
#include <vector>

#include "store/take.h"
#include "testing/test_folder.h"
#include "tests/end_to_end/run_command.h"

namespace raystage::testing {

/// For tests: two cameras with 1 MB of JPEG a second, recorded with 1 MB of memory. They count
/// their frames themselves: one that nobody took in time is a gap.
class DiskRecordingTest : public ::testing::Test {
 protected:
  static constexpr double kFps = 15;
  static constexpr int kCameras = 2;

  DiskRecordingTest() { write_config("drop_newest"); }

  /// The drops' policy, and the pictures' width in pixels.
  void write_config(const std::string& when_full, int width = 320) const {
    constexpr const char* kConfig = R"({"schema": "raystage/record/1", "name": "test",
      "node": "one", "memory_mb": 1, "when_full": "WHEN_FULL", "cameras": [
      {"id": "a", "simulated": {"index": 0, "rows": 1, "columns": 2, "width": WIDTH,
                                "fps": 15, "seconds": 0.15, "jpeg": true}},
      {"id": "b", "simulated": {"index": 1, "rows": 1, "columns": 2, "width": WIDTH,
                                "fps": 15, "seconds": 0.15, "jpeg": true}}]})";
    write_text(folder() / "record.json",
               replaced(replaced(kConfig, "WHEN_FULL", when_full), "WIDTH", std::to_string(width)));
  }
  CommandResult here(const std::string& command) const {
    return run("cd '" + folder().string() + "' && " + command);
  }
  const std::filesystem::path& folder() const { return folder_.path(); }

  /// The account of a session.
  static nlohmann::json session(const std::filesystem::path& take, std::size_t number = 0) {
    return nlohmann::json::parse(read_text(take / "recording" / "one.json"))
        .at("sessions")
        .at(number);
  }

  /// What holds whatever the disk did, as long as it can be written to in the end.
  static void expect_valid_audit(const nlohmann::json& session, double seconds) {
    EXPECT_TRUE(session.at("audit").at("passed").get<bool>()) << session.dump(1);
    EXPECT_LE(session.at("memory_peak_bytes"), session.at("memory_bytes"));
    ASSERT_EQ(session.at("cameras").size(), kCameras);
    for (const auto& camera : session.at("cameras")) {
      // Nobody held up the source.
      EXPECT_EQ(camera.at("skipped_by_source"), 0) << camera.dump(1);
      EXPECT_GE(camera.at("arrived").get<double>(), 0.8 * kFps * seconds);
      EXPECT_EQ(camera.at("arrived"), camera.at("stored").get<long>() + dropped(camera));
    }
  }
  static long dropped(const nlohmann::json& camera) {
    long sum = 0;
    for (const auto& [reason, count] : camera.at("dropped").items()) sum += count.get<long>();
    return sum;
  }

  /// Every frame of a camera, in order: stored, or why not. Each stored one is whole.
  static std::vector<FrameRecord> records(const std::filesystem::path& folder, int camera) {
    const Take take(folder);
    const ArchiveReader& archive = take.archive(camera);
    for (int i = 0; i < static_cast<int>(archive.frames().size()); ++i) {
      EXPECT_TRUE(archive.verify_frame(i)) << i;
    }
    return {archive.records().begin(), archive.records().end()};
  }
  static long count(const std::vector<FrameRecord>& records, FrameStatus status) {
    return std::ranges::count(records, status, &FrameRecord::status);
  }

  /// The lines of `--status json`.
  static std::vector<nlohmann::json> status_lines(const CommandResult& result) {
    std::vector<nlohmann::json> lines;
    std::istringstream text(result.out);
    for (std::string line; std::getline(text, line);) lines.push_back(nlohmann::json::parse(line));
    return lines;
  }

 private:
  TestFolder folder_;
};

}  // namespace raystage::testing
