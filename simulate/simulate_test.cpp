// SPDX-License-Identifier: Apache-2.0
#include "simulate/simulate.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <tbb/global_control.h>
#include <tbb/task_arena.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <map>
#include <nlohmann/json.hpp>
#include <numbers>

#include "base/atomic_file.h"
#include "base/error.h"
#include "base/options.h"
#include "images/exr_reader.h"
#include "images/image_reader.h"
#include "schemas/shot_document.h"
#include "schemas/views_document.h"
#include "simulate/exposure_schedule.h"
#include "store/jpeg/decode.h"
#include "store/take.h"
#include "store/timeline.h"
#include "testing/test_folder.h"

namespace raystage::simulate {
namespace {

namespace fs = std::filesystem;

SimulationOptions small_options() {
  SimulationOptions options;
  options.scene = "chart";
  options.rows = 2;
  options.columns = 3;
  options.cameras_per_node = 2;
  options.width = 48;
  options.height = 36;
  options.seconds = 1.2;
  options.startup_loss_s = 0.2;
  options.drop_probability = 0.1;
  options.truth_views = 3;
  options.truth_samples = 4;
  return options;
}

void simulate_with(int threads, const SimulationOptions& options, const fs::path& folder) {
  const tbb::global_control allow(tbb::global_control::max_allowed_parallelism, 4);
  tbb::task_arena arena(threads);
  arena.execute([&] { simulate(options, folder, "test"); });
}

std::map<std::string, std::string> contents(const fs::path& folder) {
  std::map<std::string, std::string> files;
  for (const auto& entry : fs::recursive_directory_iterator(folder)) {
    if (entry.is_regular_file()) {
      files[fs::relative(entry.path(), folder).string()] = read_file(entry.path());
    }
  }
  return files;
}

TEST(Simulate, SameBytesForAnyNumberOfThreads) {
  const testing::TestFolder folder;
  SimulationOptions options = small_options();
  options.scene = "stage";
  simulate_with(1, options, folder.path() / "one");
  simulate_with(4, options, folder.path() / "four");
  const auto one = contents(folder.path() / "one"), four = contents(folder.path() / "four");
  EXPECT_EQ(one.size(), 6U * 2 + 5 + 2 * 3);
  ASSERT_EQ(one.size(), four.size());
  for (const auto& [name, bytes] : one) {
    ASSERT_TRUE(four.contains(name)) << name;
    EXPECT_TRUE(four.at(name) == bytes) << name << " differs";
  }
}

// The take and the truth state the line time, a nominal calibration does not know it.
TEST(Simulate, StatesTheLineTimeOfARollingShutter) {
  const testing::TestFolder folder;
  SimulationOptions options = small_options();
  options.line_time_us = 400;
  simulate(options, folder.path() / "true", "test");
  options.nominal_calibration = true;
  simulate(options, folder.path() / "nominal", "test");
  EXPECT_EQ(store::Take(folder.path() / "true").rig().cameras[2].line_time_us, 400);
  EXPECT_EQ(store::Take(folder.path() / "nominal").rig().cameras[2].line_time_us, 0);
  const auto truth = nlohmann::json::parse(read_file(folder.path() / "nominal/truth.json"));
  EXPECT_EQ(truth.at("settings").at("line_time_us"), 400);
  EXPECT_EQ(truth.at("rig").at("cameras").at(0).at("line_time_us"), 400);
  EXPECT_FALSE(truth.at("nominal_rig").at("cameras").at(0).contains("line_time_us"));
}

/// A global and a rolling camera, whose pictures are 10 times as large as the simulated ones.
schemas::RigDocument rolling_rig() {
  schemas::RigDocument rig;
  for (const double line_time_us : {0.0, 40.0}) {
    schemas::CameraGeometry camera;
    camera.id = line_time_us == 0 ? "global" : "rolling";
    camera.width = 480;
    camera.height = 360;
    camera.intrinsics = {480, 480, 240, 180, {}};
    camera.world_from_camera = {1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1};
    camera.line_time_us = line_time_us;
    rig.cameras.push_back({camera, {}});
  }
  return rig;
}

/// Two takes of moving things by rolling_rig(), the second with this line time.
class RollingRigTakes {
 public:
  RollingRigTakes(bool nominal, double line_time_us) {
    SimulationOptions options = small_options();
    options.scene = "stage";
    options.given_rig = rolling_rig();
    options.nominal_calibration = nominal;
    options.mounting_error = options.mounting_error_deg = options.lens_deviation = 0;
    options.truth_views = 0;
    simulate(options, folder_.path() / "first", "test");
    options.line_time_us = line_time_us;
    simulate(options, folder_.path() / "second", "test");
  }
  double line_time_us(const char* take, int camera) const {
    return store::Take(folder_.path() / take).rig().cameras[camera].line_time_us;
  }
  nlohmann::json truth(const char* take) const {
    return nlohmann::json::parse(read_file(folder_.path() / take / "truth.json"));
  }
  /// Whether both takes have the same pictures of a camera.
  bool are_equal(int camera) const {
    const store::Take first(folder_.path() / "first"), second(folder_.path() / "second");
    const auto frames = static_cast<int>(first.archive(camera).frames().size());
    for (int i = 0; i < frames; ++i) {
      if (first.archive(camera).jpeg_xxh3(i) != second.archive(camera).jpeg_xxh3(i)) return false;
    }
    return true;
  }

 private:
  testing::TestFolder folder_;
};

TEST(Simulate, CamerasOfARigHaveItsLineTimes) {
  for (const bool nominal : {false, true}) {
    const RollingRigTakes takes(nominal, 400);
    EXPECT_EQ(takes.line_time_us("first", 0), 0);
    EXPECT_DOUBLE_EQ(takes.line_time_us("first", 1), 400);  // of a tenth as many rows
    EXPECT_EQ(takes.line_time_us("second", 1), nominal ? 0 : 400);
    for (const char* rig : {"rig", "nominal_rig"}) {
      const auto cameras = takes.truth("first").at(rig).at("cameras");
      EXPECT_FALSE(cameras.at(0).contains("line_time_us"));
      EXPECT_EQ(cameras.at(1).at("line_time_us"), 400);
    }
    EXPECT_TRUE(takes.truth("first").at("settings").at("line_time_us").is_null());
    EXPECT_FALSE(takes.are_equal(0));
    EXPECT_TRUE(takes.are_equal(1));
  }
}

TEST(Simulate, AGivenLineTimeReplacesThoseOfARig) {
  const RollingRigTakes takes(true, 0);
  EXPECT_EQ(takes.line_time_us("second", 1), 0);
  for (const char* rig : {"rig", "nominal_rig"}) {
    EXPECT_FALSE(takes.truth("second").at(rig).at("cameras").at(1).contains("line_time_us"));
  }
  EXPECT_TRUE(takes.are_equal(0));
  EXPECT_FALSE(takes.are_equal(1));
}

TEST(Simulate, RowsOfARigTakeAtMostAFrameTime) {
  SimulationOptions options = small_options();
  options.given_rig = rolling_rig();
  std::string reason;
  EXPECT_TRUE(options.is_valid(&reason)) << reason;
  options.fps = 1e6 / (360 * 39.0);
  options.jitter = 0;
  EXPECT_FALSE(options.is_valid(&reason));
  EXPECT_NE(reason.find("line time of camera rolling (us)"), std::string::npos) << reason;
  options.line_time_us = 389;  // of 36 rows
  EXPECT_TRUE(options.is_valid(&reason)) << reason;
  options.line_time_us = 391;
  EXPECT_FALSE(options.is_valid(&reason));
}

TEST(Simulate, RowsTakeAtMostAFrameTime) {
  SimulationOptions options = small_options();
  std::string reason;
  options.line_time_us = -1e6 / options.fps / options.height;
  EXPECT_TRUE(options.is_valid(&reason));
  *options.line_time_us *= 1.01;
  EXPECT_FALSE(options.is_valid(&reason));
  EXPECT_NE(reason.find("line time (us)"), std::string::npos) << reason;
}

class SmallTake : public ::testing::Test {
 protected:
  static void SetUpTestSuite() {
    folder_ = std::make_unique<testing::TestFolder>();
    simulate(small_options(), take_folder(), "test 1.0");
  }
  static void TearDownTestSuite() { folder_.reset(); }
  static fs::path take_folder() { return folder_->path() / "take"; }
  static inline std::unique_ptr<testing::TestFolder> folder_;
};

TEST_F(SmallTake, ArchivesHoldTheStampedTimesAndWhatIsMissing) {
  const store::Take take(take_folder());
  EXPECT_EQ(take.document().created_by, "test 1.0");
  EXPECT_EQ(take.document().clock, "simulated");
  EXPECT_EQ(take.document().timestamp_event, "exposure_middle");
  const ExposureSchedule schedule = make_exposure_schedule(small_options());
  int missing = 0;
  for (int i = 0; i < take.camera_count(); ++i) {
    const ExposureSchedule::Camera& camera = schedule.cameras[i];
    EXPECT_EQ(take.document().cameras[i].node, std::to_string(camera.node).insert(0, "node"));
    const auto records = take.archive(i).records();
    ASSERT_EQ(records.size(), camera.frames.size());
    for (std::size_t n = 0; n < records.size(); ++n) {
      EXPECT_EQ(records[n].time_ns, camera.frames[n].stamped_time);
      EXPECT_EQ(records[n].status, camera.frames[n].status);
      missing += records[n].status != store::FrameStatus::kStored ? 1 : 0;
    }
    EXPECT_TRUE(take.archive(i).was_closed());
  }
  EXPECT_GT(missing, 6 * 2) << "start-up and some drops";
  store::JpegDecoder decoder;
  const store::RgbImage frame = decoder.decode(take.archive(0).jpeg(0), "frame");
  EXPECT_EQ(frame.width, 48);
  EXPECT_EQ(frame.height, 36);
  EXPECT_TRUE(store::parse_jpeg_layout(take.archive(0).jpeg(0), "frame").regions_decodable());
}

TEST_F(SmallTake, TruthSaysWhatWasDone) {
  const auto truth = nlohmann::json::parse(read_file(take_folder() / "truth.json"));
  EXPECT_EQ(truth.at("schema"), "raystage/simulation-truth/1");
  EXPECT_EQ(truth.at("seed"), 1);
  std::map<std::string, std::int64_t> offset;
  for (const auto& node : truth.at("nodes")) offset[node.at("id")] = node.at("clock_offset_ns");
  EXPECT_EQ(offset.size(), 3U);
  const store::Take take(take_folder());
  ASSERT_EQ(truth.at("cameras").size(), 6U);
  for (int i = 0; i < 6; ++i) {
    const auto& camera = truth.at("cameras").at(i);
    const auto records = take.archive(i).records();
    for (std::size_t n = 0; n < records.size(); ++n) {
      EXPECT_EQ(camera.at("stamped_time_ns").at(n), records[n].time_ns);
      EXPECT_EQ(camera.at("status").at(n), store::name_of(records[n].status));
      EXPECT_EQ(records[n].time_ns - camera.at("true_time_ns").at(n).get<std::int64_t>(),
                offset.at(camera.at("node")));
    }
  }
  const schemas::RigDocument rig = schemas::parse_rig(truth.at("rig").dump(), "truth.json");
  EXPECT_EQ(rig.cameras[4].geometry,
            schemas::read_rig(take_folder() / "rig.json").cameras[4].geometry);
}

TEST_F(SmallTake, ViewsLieOnTheShot) {
  const schemas::ViewsDocument views = schemas::read_views(take_folder() / "views.json");
  const schemas::ShotDocument shot = schemas::read_shot(take_folder() / "shot.json");
  ASSERT_EQ(views.views.size(), 3U);
  EXPECT_EQ(shot.last_frame - shot.first_frame + 1, 48);
  const store::Take take(take_folder());
  const store::Timeline timeline = store::build_timeline(take, 0, 0);
  const schemas::ShotDocument::Layer& layer = shot.layers.at(0);
  for (const schemas::ViewsDocument::View& view : views.views) {
    const double seconds =
        static_cast<double>(view.time_ns - timeline.ticks.front().time_ns) * 1e-9;
    const double frame = shot.first_frame + (seconds - layer.start_seconds) / layer.speed *
                                                shot.fps_numerator / shot.fps_denominator;
    EXPECT_NEAR(frame, std::round(frame), 1e-5);
    EXPECT_LE(view.time_ns, timeline.ticks.back().time_ns);
    bool found = false;
    for (const schemas::ShotDocument::CameraKey& key : shot.camera.keys) {
      if (std::abs(key.frame - frame) > 1e-3) continue;
      found = true;
      const auto& pose = view.geometry.world_from_camera;
      EXPECT_NEAR(pose[3], key.position->at(0), 1e-12);
      EXPECT_NEAR(pose[11], key.position->at(2), 1e-12);
      const auto& q = *key.orientation;
      const Eigen::Matrix3d rotation =
          Eigen::Quaterniond(q[0], q[1], q[2], q[3]).toRotationMatrix();
      EXPECT_NEAR(pose[2], rotation(0, 2), 1e-12);
      EXPECT_NEAR(view.geometry.intrinsics.fx,
                  24 / std::tan(*key.horizontal_fov_deg * std::numbers::pi / 360), 1e-9);
    }
    EXPECT_TRUE(found) << "no key at frame " << frame;
    const store::RgbImage truth = images::ImageReader().read_rgb(take_folder() / view.file);
    EXPECT_EQ(truth.width, 48);
    EXPECT_EQ(truth.height, 36);
    constexpr images::ExrChannel kZ[]{{"Z"}};
    const images::ExrChannelData depths =
        images::read_exr_channels(take_folder() / view.depth_file, kZ, "test");
    ASSERT_EQ(depths.values.size(), 48U * 36);
    EXPECT_GE(std::ranges::min(depths.values), 0);
    EXPECT_GT(*std::ranges::max_element(depths.values), 3);
  }
}

TEST(Simulate, AnArrayMayStandElsewhereAndLookElsewhere) {
  SimulationOptions options = small_options();
  options.scene = "still";
  options.position = {0.5, 0.25, -1};
  options.turn_deg = 90;
  const testing::TestFolder folder;
  const fs::path made = folder.path() / "take";
  simulate_with(2, options, made);
  const store::Take take(made);
  EXPECT_LT((take.rig().centre() - Eigen::Vector3d(0.5, 0.25, -1)).norm(), 0.003);
  EXPECT_GT(take.rig().mean_viewing_direction().dot(-Eigen::Vector3d::UnitX()), 0.9999);
  // The left wall is at -6 m; only corners up to that distance are visible.
  ASSERT_TRUE(take.document().depth_range);
  EXPECT_NEAR(take.document().depth_range->far, 6.5, 0.03);
  const schemas::ShotDocument shot = schemas::read_shot(made / "shot.json");
  const schemas::ViewsDocument views = schemas::read_views(made / "views.json");
  for (const auto& view : views.views) {
    const rig::Pose pose = rig::pose_from_matrix(view.geometry.world_from_camera);
    EXPECT_LT((pose.position - Eigen::Vector3d(0.5, 0.25, -1)).norm(), 0.2);
    EXPECT_GT(pose.viewing_direction().dot(-Eigen::Vector3d::UnitX()), 0.98);
  }
  options.turn_deg = 361;
  EXPECT_THROW(require_valid(options, "simulation"), Error);
}

TEST_F(SmallTake, DepthRangeIsTheScenes) {
  const store::Take take(take_folder());
  ASSERT_TRUE(take.document().depth_range);
  // The nearest ball is at 2 m with a radius of 6 cm; the chart is at 4 m.
  EXPECT_NEAR(take.document().depth_range->near, 1.94, 0.03);
  EXPECT_NEAR(take.document().depth_range->far, 4, 0.03);
}

TEST(Simulate, NominalCalibrationHidesTheTruth) {
  const testing::TestFolder folder;
  SimulationOptions options = small_options();
  options.seconds = 0.3;
  options.truth_views = 0;
  options.nominal_calibration = true;
  simulate(options, folder.path() / "take", "test");
  const schemas::RigDocument rig = schemas::read_rig(folder.path() / "take" / "rig.json");
  EXPECT_EQ(rig.cameras[0].geometry.world_from_camera[3], -0.06);
  const auto truth = nlohmann::json::parse(read_file(folder.path() / "take" / "truth.json"));
  EXPECT_NE(schemas::parse_rig(truth.at("rig").dump(), "truth").cameras[0].geometry,
            rig.cameras[0].geometry);
  EXPECT_EQ(schemas::parse_rig(truth.at("nominal_rig").dump(), "truth").cameras[0].geometry,
            rig.cameras[0].geometry);
  EXPECT_FALSE(fs::exists(folder.path() / "take" / "views.json"));
}

TEST(Simulate, LeavesNothingWhenStopped) {
  const testing::TestFolder folder;
  std::stop_source stop;
  SimulationOptions options = small_options();
  EXPECT_THROW(simulate(
                   options, folder.path() / "take", "test",
                   [&](double done) {
                     if (done > 0.3) stop.request_stop();
                   },
                   stop.get_token()),
               Error);
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(Simulate, RefusesTakesWithoutAFrame) {
  const testing::TestFolder folder;
  SimulationOptions options = small_options();
  options.seconds = options.startup_loss_s = 0.5;
  try {
    simulate(options, folder.path() / "take", "test");
    FAIL() << "all frames are lost at start-up";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), ::testing::HasSubstr("first 0.5 s are lost at start-up"));
  }
  EXPECT_TRUE(fs::is_empty(folder.path()));
}

TEST(Simulate, DoesNotTouchWhatIsThere) {
  const testing::TestFolder folder;
  create_folder(folder.path() / "take");
  write_file_atomically(folder.path() / "take" / "note", std::string_view("mine"));
  EXPECT_THROW(simulate(small_options(), folder.path() / "take", "test"), Error);
  EXPECT_EQ(read_file(folder.path() / "take" / "note"), "mine");
}

}  // namespace
}  // namespace raystage::simulate
