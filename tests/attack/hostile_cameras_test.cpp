// SPDX-License-Identifier: Apache-2.0
// Records good cameras together with ten kinds of hostile ones.
#include "tests/attack/hostile_cameras.h"

#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <chrono>
#include <cstdio>
#include <cstdlib>
#include <memory>
#include <nlohmann/json.hpp>
#include <regex>
#include <thread>

#include "store/take.h"
#include "testing/ingest/test_pictures.h"
#include "testing/test_folder.h"
#include "tests/end_to_end/run_command.h"

namespace raystage::testing {
namespace {

namespace fs = std::filesystem;
using namespace std::chrono_literals;
using nlohmann::json;
using ::testing::HasSubstr;

constexpr int kGoodFrames = 150;
constexpr auto kGoodInterval = 33ms;
constexpr double kMegabyte = 1e6;

/// The contents of a local file that no camera may have recorded.
const std::vector<std::byte> kSecret = test_jpeg(96, 64, 201);

/// When a hostile camera begins to attack.
enum class Begin { kFirstByte, kAfterGoodFrames };

/// Recordings of each kind: RAYSTAGE_ATTACK_RUNS, or one.
int run_count() {
  const char* const text = std::getenv("RAYSTAGE_ATTACK_RUNS");
  return text == nullptr ? 1 : std::atoi(text);
}

/// Frames that differ from each other, so that each of them can be found again.
std::vector<std::vector<std::byte>> good_frames(int camera) {
  std::vector<std::vector<std::byte>> frames;
  for (int i = 0; i < kGoodFrames; ++i) frames.push_back(test_jpeg(320 + 16 * camera, 240, i));
  return frames;
}

class HostileCameras : public ::testing::TestWithParam<Begin> {
 protected:
  void SetUp() override {
#if defined(__SANITIZE_ADDRESS__) || defined(__SANITIZE_THREAD__)
    GTEST_SKIP() << "sanitizers take memory of their own";
#endif
    for (int i = 0; i < 2; ++i) {
      frames_.push_back(good_frames(i));
      add_camera("good" + std::to_string(i), "http", "", [this, i](const TestConnection& client) {
        begin_multipart(client);
        // The recorder connects again when no more frames come: none is sent twice.
        for (std::size_t at = 0; at < frames_[i].size() && !has_sent_[i]; ++at) {
          if (!send_part(client, frames_[i][at])) return;
          std::this_thread::sleep_for(kGoodInterval);
        }
        has_sent_[i] = true;
        client.wait_for_end();
      });
    }
  }

  void add_camera(const std::string& id, const std::string& scheme, const std::string& format,
                  std::function<void(const TestConnection&)> talk) {
    servers_.push_back(std::make_unique<TestServer>(std::move(talk), TestServer::kEveryClient));
    cameras_.push_back(
        {{"id", id},
         {"ffmpeg",
          {{"url", servers_.back()->url(scheme)}, {"format", format}, {"max_frame_mb", 4}}}});
  }
  void add_simulated_cameras() {
    for (int i = 0; i < 2; ++i) {
      cameras_.push_back({{"id", "simulated" + std::to_string(i)},
                          {"simulated",
                           {{"rows", 1},
                            {"columns", 2},
                            {"width", 320},
                            {"height", 240},
                            {"seconds", 0.5},
                            {"jpeg", true},
                            {"index", i}}}});
    }
  }
  void add_hostile_cameras(Begin begin, const std::string& other_host) {
    write_text(folder_.path() / "secret.jpg", text_of(kSecret));
    for (const HostileCamera& hostile :
         hostile_cameras((folder_.path() / "secret.jpg").string(), other_host)) {
      add_camera(hostile.id, hostile.scheme, hostile.format, [=](const TestConnection& client) {
        if (hostile.is_answer) return hostile.attack(client);
        if (hostile.scheme == "tcp") {
          const std::vector<std::byte> jpeg = test_jpeg(96, 64, 90);
          for (int i = 0; i < 30 && begin == Begin::kAfterGoodFrames; ++i) {
            client.send(jpeg);
            std::this_thread::sleep_for(kGoodInterval);
          }
          return hostile.attack(client);
        }
        begin_multipart(client);
        for (int i = 0; i < 30 && begin == Begin::kAfterGoodFrames; ++i) {
          send_part(client, test_jpeg(96, 64, i));
          std::this_thread::sleep_for(kGoodInterval);
        }
        hostile.attack(client);
      });
    }
  }
  CommandResult record(const fs::path& take) const {
    const json config{{"schema", "raystage/record/1"},
                      {"name", "test"},
                      {"node", "one"},
                      {"when_lost", "reconnect"},
                      {"lost_after_seconds", 2},
                      {"memory_mb", 100},
                      {"cameras", cameras_}};
    write_text(folder_.path() / "record.json", config.dump());
    return run("cd '" + folder_.path().string() + "' && ulimit -v 8000000 && timeout 120 " +
               "raystage record record.json --status none --duration 10 -o " + take.string());
  }
  /// Returns the frames of a camera in the order of their times.
  static std::vector<std::vector<std::byte>> stored_frames(const store::Take& take, int camera) {
    std::vector<std::vector<std::byte>> frames;
    const store::ArchiveReader& archive = take.archive(camera);
    for (int i = 0; i < static_cast<int>(archive.frames().size()); ++i) {
      const store::FrameBytes bytes = archive.jpeg(i);
      frames.emplace_back(bytes.begin(), bytes.end());
    }
    return frames;
  }
  void expect_good_cameras_whole(const fs::path& folder) const {
    const store::Take take(folder);
    for (int camera = 0; camera < 2; ++camera) {
      const auto stored = stored_frames(take, camera);
      // Those before the recording began are not recorded; of the others none is missing.
      ASSERT_LE(stored.size(), frames_[camera].size());
      const auto first = frames_[camera].end() - static_cast<std::ptrdiff_t>(stored.size());
      EXPECT_TRUE(std::equal(stored.begin(), stored.end(), first)) << "good camera " << camera;
    }
    for (int camera = 2; camera < static_cast<int>(take.document().cameras.size()); ++camera) {
      const auto stored = stored_frames(take, camera);
      EXPECT_EQ(std::ranges::count(stored, kSecret), 0) << "a local file was recorded";
    }
  }
  static json session(const fs::path& take) {
    return json::parse(read_text(take / "recording/one.json")).at("sessions")[0];
  }

  TestFolder folder_;
  std::vector<std::vector<std::vector<std::byte>>> frames_;  ///< of the good cameras
  std::array<std::atomic<bool>, 2> has_sent_{};              ///< all of them
  json cameras_ = json::array();
  std::vector<std::unique_ptr<TestServer>> servers_;  // the last member: its threads end first
};

TEST_P(HostileCameras, CostTheGoodOnesNoFrame) {
  const TestServer other_host([](const TestConnection& client) { client.request(); },
                              TestServer::kEveryClient, "127.0.0.2");
  add_simulated_cameras();
  add_hostile_cameras(GetParam(), other_host.url("http"));
  for (int i = 0; i < run_count(); ++i) {
    SCOPED_TRACE(i);
    for (std::atomic<bool>& has_sent : has_sent_) has_sent = false;
    const fs::path take = folder_.path() / ("take" + std::to_string(i));
    const CommandResult result = record(take);
    ASSERT_EQ(result.exit_code, 3) << result.err;
    ASSERT_TRUE(has_sent_[0] && has_sent_[1]) << "the good cameras were read too late";
    expect_good_cameras_whole(take);
    const json account = session(take);
    EXPECT_TRUE(account.at("audit").at("passed").get<bool>()) << account.dump(1);
    for (const json& camera : account.at("cameras")) {
      const std::string id = camera.at("id");
      if (!id.starts_with("good") && !id.starts_with("simulated")) {
        const bool is_noticed =
            !camera.at("events").empty() || !camera.value("dropped", json()).empty();
        EXPECT_TRUE(is_noticed) << camera.dump(1);
        continue;
      }
      EXPECT_EQ(camera.at("arrived"), camera.at("stored")) << camera.dump(1);
      EXPECT_GT(camera.at("stored"), 100) << camera.dump(1);
    }
    std::smatch stated;
    ASSERT_TRUE(std::regex_search(
        result.err, stated, std::regex("RAM: (\\d+) MB for frames.*plus up to about (\\d+) MB")))
        << result.err;
    const double announced = std::stod(stated[1]) + std::stod(stated[2]);
    const double peak = static_cast<double>(result.peak_memory) / kMegabyte;
    EXPECT_LE(peak, announced);
    std::printf("peak %.0f MB of %.0f MB stated\n", peak, announced);
    EXPECT_EQ(run("raystage verify -q '" + take.string() + "'").exit_code, 0);
    fs::remove_all(take);
  }
  EXPECT_EQ(other_host.connections(), 0);
}

INSTANTIATE_TEST_SUITE_P(Begin, HostileCameras,
                         ::testing::Values(Begin::kFirstByte, Begin::kAfterGoodFrames),
                         [](const auto& parameter) {
                           return parameter.param == Begin::kFirstByte ? "FromTheFirstByte"
                                                                       : "AfterGoodFrames";
                         });

}  // namespace
}  // namespace raystage::testing
