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

/// For tests: two cameras with 1 MB of JPEG per second, recorded with 1 MB of memory. The cameras
/// count their frames, so a frame that was not read in time is a gap.
class DiskRecordingTest : public ::testing::Test {
 protected:
  static constexpr double kFps = 15;
  static constexpr int kCameras = 2;

  DiskRecordingTest() { write_config("drop_newest"); }

  /// Writes record.json. `when_full`: which frames are dropped; `width`: of the pictures, pixels.
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

  /// Returns the record of a session.
  static nlohmann::json session(const std::filesystem::path& take, std::size_t number = 0) {
    return nlohmann::json::parse(read_text(take / "recording" / "one.json"))
        .at("sessions")
        .at(number);
  }

  /// Expects what is true for any fault of the disk, if the disk is writable at the end.
  static void expect_valid_audit(const nlohmann::json& session, double seconds) {
    EXPECT_TRUE(session.at("audit").at("passed").get<bool>()) << session.dump(1);
    EXPECT_LE(session.at("memory_peak_bytes"), session.at("memory_bytes"));
    ASSERT_EQ(session.at("cameras").size(), kCameras);
    for (const auto& camera : session.at("cameras")) {
      // The source was never blocked.
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

  /// Returns the records of a camera, missing frames included. Expects stored frames to be intact.
  static std::vector<store::FrameRecord> records(const std::filesystem::path& folder, int camera) {
    const store::Take take(folder);
    const store::ArchiveReader& archive = take.archive(camera);
    for (int i = 0; i < static_cast<int>(archive.frames().size()); ++i) {
      EXPECT_TRUE(archive.verify_frame(i)) << i;
    }
    return {archive.records().begin(), archive.records().end()};
  }
  static long count(const std::vector<store::FrameRecord>& records, store::FrameStatus status) {
    return std::ranges::count(records, status, &store::FrameRecord::status);
  }

  /// Returns the lines of `--status json`.
  static std::vector<nlohmann::json> status_lines(const CommandResult& result) {
    std::vector<nlohmann::json> lines;
    std::istringstream text(result.out);
    for (std::string line; std::getline(text, line);) lines.push_back(nlohmann::json::parse(line));
    return lines;
  }

 private:
  testing::TestFolder folder_;
};

}  // namespace raystage::testing
