// SPDX-License-Identifier: Apache-2.0
// Tests geometric calibration from frames to a rig by the commands that users run.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>
#include <string>
#include <vector>

#include "schemas/rig_document.h"
#include "testing/test_folder.h"
#include "tests/end_to_end/run_command.h"
#include "tests/end_to_end/true_rig.h"

namespace raystage {
namespace {

using testing::CommandResult;
using ::testing::HasSubstr;
using testing::run;
using testing::write_true_rig;

/// Simulates a light in the dark and twelve free-running cameras on three nodes with wrong clocks.
CommandResult simulate_light(const std::string& take) {
  return run("raystage simulate moving_light -o " + take +
             " --rows 3 --columns 4 --seconds 12 --fps 9 --mounting-deg 8 --mounting-mm 5 "
             "--lens-deviation 0 --k1 -0.089 --k2 0 --cameras-per-node 4 --truth-views 0 "
             "--startup-loss-seconds 0.2 --calibration nominal -q");
}

TEST(Calibrate, FromTheFirstFrameToTheRigInOneCommand) {
  const testing::TestFolder folder;
  const std::string take = (folder.path() / "light").string();
  ASSERT_EQ(simulate_light(take).exit_code, 0);
  const std::string rig = (folder.path() / "rig.json").string();
  const std::string page = (folder.path() / "report.html").string();
  const CommandResult found = run("raystage calibrate geometry " + take + " -o " + rig +
                                  " --spacing-mm 60 -q --report " + page);
  ASSERT_EQ(found.exit_code, 0) << found.out << found.err;
  EXPECT_THAT(found.out, HasSubstr("Verdict    accepted"));
  EXPECT_EQ(schemas::read_rig(rig).cameras.size(), 12U);
  EXPECT_THAT(testing::read_text(page), HasSubstr("r2c3"));
  const CommandResult compared =
      run("raystage calibrate compare --json " + write_true_rig(take) + " " + rig);
  ASSERT_EQ(compared.exit_code, 0) << compared.err;
  const auto comparison = nlohmann::json::parse(compared.out);
  for (const auto& camera : comparison.at("cameras")) {
    EXPECT_LE(camera.at("place_m").get<double>(), 1e-3) << camera;
    EXPECT_LE(camera.at("turn_deg").get<double>(), 0.05) << camera;
    EXPECT_LE(camera.at("rms_px").get<double>(), 1) << camera;
  }

  // The same from a table of detections; then refined from the first result with fixed lenses.
  const std::string table = (folder.path() / "light.csv").string();
  const std::string again = (folder.path() / "again.json").string();
  ASSERT_EQ(run("raystage calibrate geometry " + take + " -o " + again +
                " --spacing-mm 60 -q --detections " + table)
                .exit_code,
            0);
  const schemas::RigDocument first_time = schemas::read_rig(rig),
                             second_time = schemas::read_rig(again);
  for (std::size_t i = 0; i < first_time.cameras.size(); ++i) {
    const schemas::CameraGeometry &a = first_time.cameras[i].geometry,
                                  &b = second_time.cameras[i].geometry;
    EXPECT_NEAR(a.intrinsics.fx, b.intrinsics.fx, 1e-6);
    for (std::size_t k = 0; k < 16; ++k) {
      EXPECT_NEAR(a.world_from_camera[k], b.world_from_camera[k], 1e-9);
    }
  }
  const CommandResult refined =
      run("raystage calibrate geometry " + table + " --cameras " +
          (folder.path() / "light.cameras.json").string() + " -o " + again + " --initial-rig " +
          rig + " --fix lens --fix r0c0 -q --json");
  ASSERT_EQ(refined.exit_code, 0) << refined.out << refined.err;
  const auto report = nlohmann::json::parse(refined.out);
  EXPECT_EQ(report.at("scale_from"), "start");
  EXPECT_LE(report.at("rms_px").get<double>(), 0.2);
  // Equal up to the conversion of a rotation to a quaternion and back.
  const auto held = schemas::read_rig(again).cameras[0].geometry.world_from_camera;
  const auto before = schemas::read_rig(rig).cameras[0].geometry.world_from_camera;
  for (std::size_t i = 0; i < held.size(); ++i) EXPECT_NEAR(held[i], before[i], 1e-12);
}

TEST(Calibrate, ABoardTellsLensesThatALightCannot) {
  const testing::TestFolder folder;
  const std::string take = (folder.path() / "board").string();
  ASSERT_EQ(
      run("raystage simulate board -o " + take +
          " --rows 1 --columns 2 --seconds 7 --fps 6 --width 480 --height 360 --truth-views 0 "
          "--startup-loss-seconds 0.2 --calibration nominal -q")
          .exit_code,
      0);
  const std::string lens = (folder.path() / "lens.json").string();
  const std::string board = " --board 10x7 --square-mm 30 -q";
  const CommandResult found = run("raystage calibrate lens " + take + board + " -o " + lens);
  ASSERT_EQ(found.exit_code, 0) << found.out << found.err;
  const schemas::RigDocument truth = schemas::read_rig(write_true_rig(take)),
                             measured = schemas::read_rig(lens);
  EXPECT_FALSE(schemas::is_calibrated(measured));  // lenses only
  for (std::size_t i = 0; i < truth.cameras.size(); ++i) {
    const schemas::Intrinsics &expected = truth.cameras[i].geometry.intrinsics,
                              &k = measured.cameras[i].geometry.intrinsics;
    EXPECT_NEAR(k.fx, expected.fx, 0.005 * expected.fx);
    EXPECT_NEAR(k.cx, expected.cx, 2);
    EXPECT_NEAR(k.cy, expected.cy, 2);
  }
  // The board also determines the positions of the cameras in metres.
  const std::string rig = (folder.path() / "rig.json").string();
  const CommandResult placed = run("raystage calibrate geometry " + take + board + " -o " + rig +
                                   " --lens " + lens + " --lens-per-camera --fix lens --json");
  ASSERT_EQ(placed.exit_code, 0) << placed.out << placed.err;
  EXPECT_EQ(nlohmann::json::parse(placed.out).at("scale_from"), "board");
  const auto compared = nlohmann::json::parse(
      run("raystage calibrate compare --json " + write_true_rig(take) + " " + rig).out);
  EXPECT_NEAR(compared.at("scale").get<double>(), 1, 0.01);
  EXPECT_EQ(run("raystage calibrate lens " + take + " --board 13x9 --square-mm 30 -q -o " + lens)
                .exit_code,
            2);
  EXPECT_EQ(run("raystage calibrate lens " + take + " --board 9by7 --square-mm 30 -q -o " + lens)
                .exit_code,
            2);
}

TEST(Calibrate, ABoardTellsTheModelOfAFisheye) {
  const testing::TestFolder folder;
  const std::string take = (folder.path() / "board").string();
  ASSERT_EQ(
      run("raystage simulate board_around -o " + take +
          " --lens equisolid --fov-deg 190 --rows 1 --columns 1 --seconds 9 --fps 5 --width 640 "
          "--height 640 --truth-views 0 --startup-loss-seconds 0 --calibration nominal -q")
          .exit_code,
      0);
  const std::string lens = (folder.path() / "lens.json").string();
  const std::string command =
      "raystage calibrate lens " + take + " --board 10x7 --square-mm 30 -q -o " + lens;
  const CommandResult found = run(command + " --lens-model auto --half-angle-deg 110 --json");
  ASSERT_EQ(found.exit_code, 0) << found.out << found.err;
  const auto report = nlohmann::json::parse(found.out);
  const auto& models = report.at("cameras").at(0).at("models");
  EXPECT_EQ(report.at("cameras").at(0).at("projection"), "equisolid") << models;
  EXPECT_EQ(models.at(0).at("rank"), "worse");
  const schemas::Intrinsics written = schemas::read_rig(lens).cameras[0].geometry.intrinsics;
  const schemas::Intrinsics truth =
      schemas::read_rig(write_true_rig(take)).cameras[0].geometry.intrinsics;
  EXPECT_EQ(written.projection, schemas::Projection::kEquisolid);
  EXPECT_NEAR(written.fx, truth.fx, 0.005 * truth.fx);
  EXPECT_NEAR(written.half_angle.value_or(0), 110 * 3.14159265358979 / 180, 1e-12);
  // A chosen model is kept, whether or not it is the best.
  const CommandResult chosen = run(command + " --lens-model orthographic --force");
  EXPECT_EQ(chosen.exit_code, 0) << chosen.err;
  EXPECT_EQ(schemas::read_rig(lens).cameras[0].geometry.intrinsics.projection,
            schemas::Projection::kOrthographic);
  EXPECT_EQ(run(command + " --lens-model barrel").exit_code, 2);
  const std::string geometry =
      "raystage calibrate geometry " + take + " --board 10x7 --square-mm 30 -q -o " + lens;
  EXPECT_EQ(run(geometry + " --lens-model auto").exit_code, 2);
  EXPECT_EQ(run(geometry + " --lens-model ftheta --lens " + lens).exit_code, 2);
  EXPECT_EQ(run(geometry + " --lens-model pinhole --fov-deg 170").exit_code, 2);
}

/// Returns the names of the models that a report of several calls best, or as good.
std::vector<std::string> likely_models(const nlohmann::json& report) {
  std::vector<std::string> names;
  for (const auto& model : report.at("models")) {
    const std::string rank = model.value("rank", "does not fit");
    if (rank == "best" || rank == "not distinguishable") names.push_back(model.at("projection"));
  }
  return names;
}

TEST(Calibrate, ALightTellsTheModelOfAnArrayOfFisheyes) {
  const testing::TestFolder folder;
  const std::string take = (folder.path() / "light").string();
  ASSERT_EQ(run("raystage simulate moving_light_around -o " + take +
                " --lens equisolid --fov-deg 200 --rows 2 --columns 3 --width 400 --height 400 "
                "--seconds 20 --fps 10 --mounting-deg 8 --mounting-mm 5 --lens-deviation 0 "
                "--truth-views 0 --startup-loss-seconds 0 --calibration nominal -q")
                .exit_code,
            0);
  const std::string rig = (folder.path() / "rig.json").string();
  // The light does not reach the corners of the pictures, at 141 degrees.
  const CommandResult found =
      run("raystage calibrate geometry " + take + " -o " + rig +
          " --spacing-mm 60 -q --lens-model auto --half-angle-deg 114 --json");
  ASSERT_EQ(found.exit_code, 0) << found.out << found.err;
  const auto report = nlohmann::json::parse(found.out);
  EXPECT_LE(report.at("rms_px").get<double>(), 0.3);
  // OpenCV's fisheye has as many terms as a polynomial needs to pass for any model.
  EXPECT_THAT(likely_models(report), ::testing::Contains("equisolid"));
  EXPECT_THAT(likely_models(report), ::testing::IsSubsetOf({"equisolid", "fisheye"}));
  const auto compared = nlohmann::json::parse(
      run("raystage calibrate compare --json " + write_true_rig(take) + " " + rig).out);
  ASSERT_EQ(compared.at("cameras").size(), 6U);
  for (const auto& camera : compared.at("cameras")) {
    EXPECT_LE(camera.at("position_m").get<double>(), 2e-3) << camera;
    EXPECT_LE(camera.at("rotation_deg").get<double>(), 0.1) << camera;
  }
}

TEST(Calibrate, WritesNothingThatCannotBeReliedUpon) {
  const testing::TestFolder folder;
  const std::string take = (folder.path() / "light").string();
  // Cameras with equal rotations on nodes with different clocks.
  ASSERT_EQ(run("raystage simulate moving_light -o " + take +
                " --rows 1 --columns 3 --seconds 8 --fps 9 --mounting-deg 0 --width 160 --height "
                "120 --truth-views 0 --cameras-per-node 1 -q")
                .exit_code,
            0);
  const std::string rig = (folder.path() / "rig.json").string();
  const std::string command = "raystage calibrate geometry " + take + " -q -o " + rig;
  const CommandResult refused = run(command);
  EXPECT_EQ(refused.exit_code, 1);
  EXPECT_FALSE(std::filesystem::exists(rig));
  EXPECT_THAT(refused.out, HasSubstr("focal length"));
  EXPECT_THAT(refused.out, HasSubstr("The scale is unknown"));
  EXPECT_THAT(refused.err, HasSubstr("--force"));
  EXPECT_EQ(run(command + " --force").exit_code, 0);
  EXPECT_EQ(schemas::read_rig(rig).cameras.size(), 3U);
}

TEST(Calibrate, SaysWhatIsWrongWithWhatItIsGiven) {
  const testing::TestFolder folder;
  const std::string nowhere = (folder.path() / "nowhere").string();
  const std::string rig = (folder.path() / "rig.json").string();
  EXPECT_EQ(run("raystage calibrate geometry " + nowhere + " -o " + rig).exit_code, 2);
  EXPECT_EQ(run("raystage calibrate").exit_code, 2);
  EXPECT_EQ(run("raystage calibrate geometry").exit_code, 2);
  testing::write_text(folder.path() / "cameras.json",
                      R"({"schema": "raystage/detections/1", "cameras": [
                          {"id": "a", "width": 640, "height": 480},
                          {"id": "b", "width": 640, "height": 480}]})");
  const std::string table = (folder.path() / "empty.csv").string();
  testing::write_text(table, "camera,frame,u,v\na,0,1,2\nb,0,3,4\n");
  const CommandResult empty = run("raystage calibrate geometry " + table + " -o " + rig);
  EXPECT_EQ(empty.exit_code, 2) << empty.err;
  EXPECT_THAT(empty.err, HasSubstr("no two cameras see enough"));
  const CommandResult held =
      run("raystage calibrate geometry " + table + " -o " + rig + " --fix poses");
  EXPECT_EQ(held.exit_code, 2);
  EXPECT_THAT(held.err, HasSubstr("--initial-rig"));
  const CommandResult unknown_lens =
      run("raystage calibrate geometry " + table + " -o " + rig + " --fix lens");
  EXPECT_EQ(unknown_lens.exit_code, 2);
  EXPECT_THAT(unknown_lens.err,
              AllOf(HasSubstr("no lens is given"), HasSubstr("(--lens, --initial-rig)")));
  EXPECT_EQ(run("raystage calibrate geometry " + table + " -o " + rig + " --fix lense").exit_code,
            2);
  EXPECT_EQ(run("raystage calibrate geometry " + table + " -o " + nowhere + "/rig.json").exit_code,
            1);
  EXPECT_EQ(run("raystage calibrate geometry " + table + " -o " + rig + " --distance a b never")
                .exit_code,
            2);
}

}  // namespace
}  // namespace raystage
