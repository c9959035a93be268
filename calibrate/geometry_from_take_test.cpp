// SPDX-License-Identifier: Apache-2.0
#include "calibrate/geometry_from_take.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <Eigen/Geometry>
#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "base/error.h"
#include "calibrate/geometry/rig_comparison.h"
#include "simulate/simulate.h"
#include "testing/test_folder.h"

namespace raystage::calibrate {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

const std::vector<schemas::DetectionsDocument::Camera> kCameras{{"a", 640, 480}, {"b", 640, 480}};

schemas::RigDocument lens_document(const std::vector<std::string>& ids, int width = 640) {
  schemas::RigDocument rig;
  for (const std::string& id : ids) {
    schemas::RigDocument::Camera& camera = rig.cameras.emplace_back();
    camera.geometry.id = id;
    camera.geometry.width = width;
    camera.geometry.height = 480;
    camera.geometry.intrinsics = {
        500.0 + static_cast<double>(rig.cameras.size()), 500, 320, 240, {}};
  }
  return rig;
}

template <typename Function>
Error error_of(Function&& function) {
  try {
    function();
  } catch (const Error& error) {
    return error;
  }
  ADD_FAILURE() << "no error";
  return Error::failed("", "", "");
}

TEST(InitialLenses, AreFoundByIdOrAreTheOnlyOne) {
  const auto by_id = initial_lenses(lens_document({"b", "a"}), "lens.json", kCameras);
  ASSERT_EQ(by_id.size(), 2U);
  EXPECT_EQ(by_id[0].fx, 502);
  EXPECT_EQ(by_id[1].fx, 501);
  const auto only = initial_lenses(lens_document({"z"}), "lens.json", kCameras);
  ASSERT_EQ(only.size(), 2U);
  EXPECT_EQ(only[0].fx, 501);
  EXPECT_EQ(only[1].fx, 501);
}

TEST(InitialLenses, AreRejectedForMissingCamerasAndOtherFrameSizes) {
  for (const std::vector<std::string>& ids :
       {std::vector<std::string>{}, std::vector<std::string>{"a", "z"}}) {
    const Error missing =
        error_of([&] { initial_lenses(lens_document(ids), "lens.json", kCameras); });
    EXPECT_THAT(missing.what(), HasSubstr("there is no lens for camera"));
    EXPECT_EQ(missing.where(), "lens.json");
  }
  const Error size = error_of([] {
    initial_lenses(lens_document({"a", "b"}, 320), "lens.json", kCameras);
  });
  EXPECT_THAT(size.what(), HasSubstr("pictures of 320x480, camera \"a\" has 640x480"));
}

TEST(CalibrationOptions, NameTheSettingsThatContradict) {
  CalibrationOptions settings;
  EXPECT_NO_THROW(check_calibration_options(settings, kCameras));
  settings.solve.lens_is_known = true;
  EXPECT_THAT(error_of([&] { check_calibration_options(settings, kCameras); }).settings(),
              ElementsAre("lens", "initial_rig"));
  settings.solve.lenses = initial_lenses(lens_document({"a"}), "lens.json", kCameras);
  EXPECT_NO_THROW(check_calibration_options(settings, kCameras));
  settings.solve.horizontal_fov = 3;
  EXPECT_THAT(error_of([&] { check_calibration_options(settings, kCameras); }).settings(),
              ElementsAre("fov_deg", "lens_model"));
  settings.solve.lens_models.assign(2, {schemas::Projection::kFtheta});
  EXPECT_NO_THROW(check_calibration_options(settings, kCameras));
  settings.fixed_cameras = {"b"};
  settings.scale.distance = {"a", "c", 1.0};
  EXPECT_THAT(error_of([&] { check_calibration_options(settings, kCameras); }).what(),
              HasSubstr("no camera \"c\""));
}

TEST(BoardCalibrationSettings, UseAllCornersOfStillInstants) {
  Board board;
  board.columns = 10;
  board.rows = 7;
  board.square = 0.03;
  const TrackCalibrationOptions settings = board_calibration_options(board, std::nullopt);
  EXPECT_EQ(settings.calibration.board.size(), 54U);
  EXPECT_TRUE(settings.points.prefers_still_instants);
  EXPECT_EQ(settings.points.max_points, 80);
  EXPECT_EQ(board_calibration_options(board, 20).points.max_points, 20);
}

// A whole simulated take: 240 rows in 15 ms, node clocks up to 3 ms apart, no line time in
// rig.json.
TEST(LightTakes, ShowTheLineTime) {
  simulate::SimulationOptions options;
  options.scene = "moving_light";
  options.seed = 2;
  options.rows = 5;
  options.columns = 2;
  options.spacing = 0.1;
  options.mounting_error_deg = 4;
  options.lens_deviation = 0;
  options.nominal_calibration = true;
  options.seconds = 12;
  options.clock_offset = 0.003;
  options.cameras_per_node = 4;
  options.startup_loss_s = 0;
  options.line_time_us = 62.5;
  options.truth_views = 0;
  const testing::TestFolder folder;
  simulate::simulate(options, folder.path() / "take", "test");
  const store::Take take(folder.path() / "take");
  const RecordedTracks tracks = record_light_tracks(take, {}, [](double) {}, {});
  EXPECT_THAT(tracks.line_times_us, ::testing::Each(0));
  TrackCalibrationOptions settings;
  settings.calibration.scale.spacing_m = options.spacing;
  const TrackCalibration found = calibrate_from_tracks(tracks, settings);
  const LineTimes::Camera& line = found.calibration.line_times.cameras.front();
  EXPECT_EQ(line.source, LineTimes::Source::kFoundCommon);
  EXPECT_NEAR(line.us, *options.line_time_us, 0.03 * *options.line_time_us);
  EXPECT_LT(line.deviation_us, 0.03 * *options.line_time_us);
  EXPECT_TRUE(found.calibration.verdict.is_accepted());
}

// A whole simulated take of fisheyes that see 200 degrees; the rig states only the design.
TEST(LightTakes, CalibrateFisheyes) {
  simulate::SimulationOptions options;
  options.scene = "moving_light_around";
  options.lens = schemas::Projection::kFtheta;
  options.horizontal_fov_deg = 200;
  options.rows = 2;
  options.columns = 3;
  options.spacing = 0.1;
  options.width = 400;
  options.height = 400;
  options.mounting_error_deg = 8;
  options.lens_deviation = 0;
  options.seconds = 20;
  options.fps = 10;
  options.startup_loss_s = 0;
  options.truth_views = 0;
  const testing::TestFolder folder;
  options.nominal_calibration = true;
  simulate::simulate(options, folder.path() / "take", "test");
  const auto document = nlohmann::json::parse(read_file(folder.path() / "take" / "truth.json"));
  const schemas::RigDocument truth = schemas::parse_rig(document.at("rig").dump(), "truth");
  const store::Take take(folder.path() / "take");
  TrackCalibrationOptions settings;
  settings.calibration.scale.spacing_m = options.spacing;
  settings.calibration.solve.lens_models = recorded_lens_models(take);
  EXPECT_EQ(settings.calibration.solve.lens_models.front().projection,
            schemas::Projection::kFtheta);
  // The light does not reach the corners of the pictures, at 141 degrees.
  for (LensModel& model : settings.calibration.solve.lens_models) model.half_angle = 2;
  const TrackCalibration found =
      calibrate_from_tracks(record_light_tracks(take, {}, [](double) {}, {}), settings);
  EXPECT_TRUE(found.calibration.verdict.is_accepted())
      << ::testing::PrintToString(found.calibration.verdict.reasons);
  EXPECT_LE(rms_reprojection_error(found.calibration.model), 0.3);
  const RigComparison compared =
      compare_rigs(truth, make_rig_document(found.calibration, {}, "found"), 1);
  ASSERT_EQ(compared.cameras.size(), 6U);
  for (const auto& camera : compared.cameras) {
    EXPECT_LE(camera.position_m, 2e-3) << camera.id;
    EXPECT_LE(camera.rotation_deg, 0.1) << camera.id;
  }
}

/// Fisheyes whose rig is a little wrong see a set that does not move.
TEST(SceneFeatures, RealignFisheyes) {
  simulate::SimulationOptions options;
  options.scene = "still";
  options.lens = schemas::Projection::kEquisolid;
  options.horizontal_fov_deg = 150;
  options.rows = 2;
  options.columns = 2;
  options.spacing = 0.2;
  options.width = 640;
  options.height = 480;
  options.mounting_error_deg = 3;
  options.seconds = 1;
  options.startup_loss_s = 0;
  options.truth_views = 0;
  const testing::TestFolder folder;
  simulate::simulate(options, folder.path() / "take", "test");
  const store::Take take(folder.path() / "take");
  CalibrationOptions settings;
  const schemas::RigDocument truth = schemas::read_rig(folder.path() / "take" / "rig.json");
  settings.start = truth;
  for (std::size_t i = 0; i < truth.cameras.size(); ++i) {
    rig::Pose pose = rig::pose_from_matrix(truth.cameras[i].geometry.world_from_camera);
    const double side = i % 2 == 0 ? 1 : -1;
    pose.position += Eigen::Vector3d(0.01 * side, i < 2 ? -0.01 : 0.01, 0.004 * side);
    pose.world_from_camera_rotation =
        pose.world_from_camera_rotation *
        Eigen::AngleAxisd(0.008 * side, Eigen::Vector3d(1, i < 2 ? 1 : -1, 0.5).normalized())
            .toRotationMatrix();
    settings.start->cameras[i].geometry.world_from_camera = rig::matrix_from_pose(pose);
  }
  settings.solve.lens_is_known = true;
  FeatureMatchingOptions features;
  features.lenses = known_lenses(settings, detection_cameras(take));
  EXPECT_EQ(features.lenses.size(), 4U);
  const Detections detections =
      match_scene_features(take, std::nullopt, features, [](double) {}, {});
  // Points beside the axis, where a fundamental matrix of pixels fails, are among them.
  int wide = 0;
  for (const Detections::Detection& d : detections.detections) {
    const auto ray =
        take.rig().cameras[static_cast<std::size_t>(d.camera)].model.unproject(d.pixel);
    wide += ray && -ray->z() < 0.64 ? 1 : 0;  // 50 degrees
  }
  EXPECT_GE(wide, 50);
  const Calibration found = calibrate(detections, settings);
  EXPECT_LE(rms_reprojection_error(found.model), 1);
  const RigComparison before = compare_rigs(truth, *settings.start, 0),
                      after = compare_rigs(truth, make_rig_document(found, settings.start, ""), 0);
  for (std::size_t i = 0; i < after.cameras.size(); ++i) {
    EXPECT_LE(after.cameras[i].position_m, 0.003) << after.cameras[i].id;
    // Most of it is common to all: the comparison aligns positions, which are off by millimetres.
    EXPECT_LE(after.cameras[i].rotation_deg, 0.2) << after.cameras[i].id;
    EXPECT_LE(after.cameras[i].rotation_deg, 0.5 * before.cameras[i].rotation_deg);
  }
}

}  // namespace
}  // namespace raystage::calibrate
