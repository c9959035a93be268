// SPDX-License-Identifier: Apache-2.0
// Tests with takes that other projects captured; skipped if they are not available.
#include <gtest/gtest.h>

#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <sstream>

#include "base/atomic_file.h"
#include "schemas/import_manifest.h"
#include "store/processing/sync/resync.h"
#include "testing/test_data.h"

namespace raystage::store {
namespace {

TEST(CapturedTakes, StageTicksHoldTheFramesThatAreNearest) {
  const auto file = testing::test_data() / "stage" / "take.json";
  if (!std::filesystem::exists(file)) GTEST_SKIP() << "no captured light field stage";
  const auto json = nlohmann::json::parse(read_file(file));
  std::vector<CameraTimestamps> cameras;
  std::map<std::string, std::size_t> index;
  for (const auto& camera : json["cameras"]) {
    index[camera["id"]] = cameras.size();
    cameras.push_back({camera["id"], "", {}, {}});
  }
  for (const auto& frame : json["frames"]) {
    CameraTimestamps& camera = cameras[index.at(frame["camera"])];
    ASSERT_EQ(frame["frame"], camera.stamps.size());
    camera.stamps.push_back(std::llround(frame["time_s"].get<double>() * 1e9));
  }
  for (const bool exact : {true, false}) {
    const ResyncResult result = resynchronise(cameras, {.trust_timestamps = exact}, "stage");
    EXPECT_NEAR(result.timeline.fps, 15, 0.03);
    EXPECT_TRUE(result.steps.empty());
    ASSERT_GE(result.timeline.ticks.size(), 5u);
    int held = 0;
    for (const FrameSelection& tick : result.timeline.ticks) {
      for (std::size_t c = 0; c < cameras.size(); ++c) {
        const auto& stamps = cameras[c].stamps;
        const auto nearest = std::ranges::min_element(
            stamps, {}, [&](Nanoseconds stamp) { return std::abs(stamp - tick.time_ns); });
        const bool within = std::abs(*nearest - tick.time_ns) <= result.timeline.tolerance;
        if (tick.frame[c] >= 0) {
          EXPECT_EQ(tick.frame[c], nearest - stamps.begin()) << cameras[c].id;
          ++held;
        } else {
          // Absent only if another tick uses that frame.
          EXPECT_TRUE(!within ||
                      std::ranges::any_of(result.timeline.ticks, [&](const FrameSelection& other) {
                        return other.frame[c] == nearest - stamps.begin();
                      }));
        }
      }
    }
    EXPECT_GE(held, 64 * 5);
  }
}

TEST(CapturedTakes, FourWebcamsAreGroupedAsTheirOwnRecorderGroupedThem) {
  const auto folder = testing::test_data() / "four_webcams";
  if (!std::filesystem::exists(folder)) GTEST_SKIP() << "no captured take four_webcams";
  const schemas::ImportManifest manifest = schemas::read_import_manifest(folder / "import.json");
  std::vector<CameraTimestamps> cameras;
  for (const auto& camera : manifest.cameras) {
    cameras.push_back({camera.geometry.id, "", camera.times_ns, {}});
  }
  ASSERT_EQ(cameras.size(), 4u);
  // sync_index,cam_id,frame_time (s)
  std::map<int, std::map<std::size_t, double>> groups;
  std::ifstream table(folder / "calibration" / "extrinsic" / "timestamps.csv");
  std::string line;
  std::getline(table, line);
  while (std::getline(table, line)) {
    int group = 0, camera = 0;
    double time = 0;
    ASSERT_EQ(std::sscanf(line.c_str(), "%d,%d,%lf", &group, &camera, &time), 3) << line;
    groups[group][camera] = time;
  }
  ASSERT_EQ(groups.size(), 57u);

  for (const bool exact : {true, false}) {
    const ResyncResult result = resynchronise(cameras, {.trust_timestamps = exact}, "four_webcams");
    // For each frame: are the other frames of its tick those of its group?
    int frames = 0, agreeing = 0;
    for (const auto& [number, group] : groups) {
      for (const auto& [c, time] : group) {
        ++frames;
        const auto frame_of = [&, &group = group](std::size_t camera) {
          const auto found = group.find(camera);
          if (found == group.end()) return -1L;
          const auto stamp = std::llround(found->second * 1e9);
          const auto& stamps = cameras[camera].stamps;
          const auto at = std::ranges::min_element(
              stamps, {}, [&](Nanoseconds s) { return std::abs(s - stamp); });
          return static_cast<long>(at - stamps.begin());
        };
        const auto tick = std::ranges::find_if(
            result.timeline.ticks,
            [&, c = c](const FrameSelection& t) { return t.frame[c] == frame_of(c); });
        if (tick == result.timeline.ticks.end()) continue;
        bool same = true;
        for (std::size_t other = 0; other < 4; ++other) {
          same = same && tick->frame[other] == frame_of(other);
        }
        agreeing += same ? 1 : 0;
      }
    }
    std::printf("four_webcams, %s stamps: %d of %d frames grouped alike, %zu ticks at %.4f Hz\n",
                exact ? "exact" : "jittered", agreeing, frames, result.timeline.ticks.size(),
                result.timeline.fps);
    EXPECT_GE(agreeing, 0.99 * frames);
  }
}

}  // namespace
}  // namespace raystage::store
