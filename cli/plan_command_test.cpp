// SPDX-License-Identifier: Apache-2.0
// raystage plan as users run it.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <filesystem>
#include <nlohmann/json.hpp>
#include <string>
#include <tuple>

#include "base/atomic_file.h"
#include "schemas/shot_document.h"
#include "schemas/take_document.h"
#include "testing/cli/test_command.h"
#include "testing/compose/sequence_test_data.h"
#include "testing/test_data.h"
#include "testing/test_folder.h"
#include "testing/test_paths.h"

namespace raystage::cli {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

class PlanCommand : public ::testing::Test {
 protected:
  PlanCommand() {
    testing::write_wall_take(folder_.path() / "take");
    shot_ = testing::wall_shot();
    shot_.camera.keys = {testing::camera_key(101, {0.05, -0.05, 0.01}, 40),
                         testing::camera_key(106, {0.15, -0.05, 0.01}, 40)};
  }

  std::string path(const std::string& name) const {
    return "'" + (folder_.path() / name).string() + "'";
  }
  testing::CommandResult check(const std::string& options = "") const {
    schemas::write_shot(shot_, folder_.path() / "shot.json");
    return testing::run_raystage("plan check " + path("shot.json") + " " + options);
  }

  testing::TestFolder folder_;
  schemas::ShotDocument shot_;
};

TEST_F(PlanCommand, CheckSaysWhatFallsShort) {
  const testing::CommandResult all = check();
  EXPECT_EQ(all.exit_code, 0) << all.output;
  EXPECT_THAT(all.output, HasSubstr("of the rays were recorded by no camera"));
  EXPECT_THAT(all.output, HasSubstr("outside of its range of motion at frame 106"));
  EXPECT_EQ(check("--least-coverage 0.99").exit_code, 4);
  EXPECT_EQ(check("--frames 101 --least-coverage 1").exit_code, 0);
  EXPECT_EQ(check("--frames 101 --least-resolution 0.99").exit_code, 0);
  shot_.width = 400;
  shot_.height = 300;
  EXPECT_EQ(check("--frames 101 --least-resolution 0.99").exit_code, 4);
}

TEST_F(PlanCommand, CheckWritesReportAndNearestPath) {
  const testing::CommandResult result =
      check("--json --report " + path("r.html") + " --nearest-path " + path("near.json"));
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, HasSubstr("the camera is shifted by up to"));
  const auto json = nlohmann::json::parse(result.output.substr(result.output.find('{')));
  EXPECT_GT(json.at("unrecorded_share"), 0.5);
  EXPECT_THAT(read_file(folder_.path() / "r.html"), HasSubstr("Effective resolution"));
  // At the third instant a camera is absent.
  const testing::CommandResult near = testing::run_raystage(
      "plan check " + path("near.json") + " --frames 101-102,104-106 --least-coverage 0.999999");
  EXPECT_EQ(near.exit_code, 0) << near.output;
  EXPECT_EQ(schemas::read_shot(folder_.path() / "near.json").layers.size(), shot_.layers.size());
}

TEST_F(PlanCommand, CheckComparesWithAMotionRigAndABench) {
  EXPECT_THAT(check().output, HasSubstr("Accuracy and time are not measured"));
  EXPECT_THAT(check("--milo").output,
              HasSubstr("A motion control rig with the given limits could follow it."));
  const testing::CommandResult slow = check("--milo --rig-track-speed 0.1 --rig-reach 0.5");
  EXPECT_EQ(slow.exit_code, 0);
  EXPECT_THAT(slow.output, HasSubstr("m/s at frame 10"));
  EXPECT_THAT(slow.output, HasSubstr("; the rig does 0.1 m/s."));
  write_file_atomically(folder_.path() / "trade.json", R"({"schema": "raystage/trade/1", "rows": [
      {"label": "one plane", "method": "focal_plane", "psnr_db": 24, "seconds_per_frame": 30,
       "on_psnr_front": true}]})");
  EXPECT_THAT(
      check("--bench " + path("trade.json")).output,
      HasSubstr("Measured with one plane at the size of the bench's views: 24.0 dB, 30 s a frame, "
                "3 min for 6 frames."));
  EXPECT_EQ(check("--bench " + path("shot.json")).exit_code, 2);
}

TEST_F(PlanCommand, CheckReadsNoMeshes) {
  schemas::ShotDocument::Layer mesh;
  mesh.name = "mesh";
  schemas::ShotDocument::Geometry geometry;
  geometry.file = "missing.obj";
  mesh.geometry = geometry;
  shot_.layers.push_back(mesh);
  const testing::CommandResult result = check();
  EXPECT_EQ(result.exit_code, 0) << result.output;
  const testing::CommandResult path_result = check("--nearest-path " + path("near.json"));
  EXPECT_EQ(path_result.exit_code, 0) << path_result.output;
  EXPECT_EQ(schemas::read_shot(folder_.path() / "near.json").layers.size(), 2U);
}

TEST_F(PlanCommand, ReplacesNeitherTheShotNorItsResult) {
  const testing::CommandResult same = check("--nearest-path " + path("shot.json"));
  EXPECT_EQ(same.exit_code, 2) << same.output;
  EXPECT_THAT(same.output, HasSubstr("would replace the shot"));
  EXPECT_EQ(schemas::read_shot(folder_.path() / "shot.json").camera.keys.size(), 2U);
  EXPECT_EQ(check("--report " + path("shot.json")).exit_code, 2);
  EXPECT_EQ(check("--frames 101 --nearest-path " + path("near.json")).exit_code, 2);
  shot_.camera.keys = {testing::camera_key(101, {0.05, -0.05, 0}, 40)};
  EXPECT_THAT(check("--nearest-path " + path("near.json")).output,
              HasSubstr("no shift of the camera is needed"));
  EXPECT_THAT(check("--frames 101").output, HasSubstr("1 frame (101)"));
}

TEST_F(PlanCommand, WhatIsWrongIsBadInput) {
  EXPECT_EQ(testing::run_raystage("plan check " + path("none.json")).exit_code, 2);
  EXPECT_EQ(check("--least-coverage 1.1").exit_code, 2);
  EXPECT_EQ(check("--least-coverage nan").exit_code, 2);
  shot_.layers[0].take = "elsewhere";
  EXPECT_EQ(check().exit_code, 2);
}

TEST_F(PlanCommand, RenderBeginsWithTheVerdict) {
  schemas::write_shot(shot_, folder_.path() / "shot.json");
  const testing::CommandResult result = testing::run_raystage(
      "render " + path("shot.json") + " --progress plain -o " + path("out/f.####.exr"));
  EXPECT_EQ(result.exit_code, 0) << result.output;
  const auto verdict = result.output.find("of a frame were recorded by no camera");
  ASSERT_NE(verdict, std::string::npos) << result.output;
  EXPECT_LT(verdict, result.output.find("writing 6 frames"));
}

TEST_F(PlanCommand, ResolutionOfATake) {
  const testing::CommandResult result =
      testing::run_raystage("plan resolution " + path("take") + " --report " + path("r.html"));
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(result.output, HasSubstr("4 cameras, 64 pixels"));
  EXPECT_THAT(read_file(folder_.path() / "r.html"), Not(HasSubstr("nan")));
}

TEST_F(PlanCommand, EpiMeasuresAndWritesTheDepthRange) {
  const std::string take = path("measured");
  ASSERT_EQ(
      testing::run_raystage("simulate chart -q --rows 3 --columns 3 --seconds 0.7 --truth-views 0 "
                            "--spacing-mm 100 -o " +
                            take)
          .exit_code,
      0);
  const testing::CommandResult unsynced = testing::run_raystage("plan epi " + take);
  EXPECT_EQ(unsynced.exit_code, 2);
  EXPECT_THAT(unsynced.output, HasSubstr("raystage sync"));
  schemas::TakeDocument document = schemas::read_take(folder_.path() / "measured/take.json");
  document.depth_range.reset();
  schemas::write_take(document, folder_.path() / "measured/take.json");
  const testing::CommandResult sync = testing::run_raystage("sync " + take);
  EXPECT_EQ(sync.exit_code, 0) << sync.output;
  EXPECT_THAT(sync.output, HasSubstr("raystage plan epi"));
  const testing::CommandResult result =
      testing::run_raystage("plan epi " + take + " --write -q --json --report " + path("epi.html"));
  EXPECT_EQ(result.exit_code, 0) << result.output;
  const auto json = nlohmann::json::parse(result.output.substr(result.output.find('{')));
  const auto range = schemas::read_take(folder_.path() / "measured/take.json").depth_range;
  ASSERT_TRUE(range);
  EXPECT_EQ(json["depth_range_m"], (nlohmann::json{range->near, range->far}));
  EXPECT_NEAR(range->near, 1.94, 0.15);  // a ball
  EXPECT_GT(range->far, 4);              // the wall
  EXPECT_EQ(json["epipolar_images"].size(), 2U);
  EXPECT_GE(json["epipolar_images"][0]["cameras"].size(), 2U);  // one may lack its frame
  EXPECT_THAT(read_file(folder_.path() / "epi.html"), HasSubstr("data:image/jpeg;base64,"));
  EXPECT_THAT(testing::run_raystage("sync " + take).output, Not(HasSubstr("raystage plan epi")));
}

TEST_F(PlanCommand, EpiSaysWhereNothingCanBeMeasured) {
  const std::string take = path("dark");
  ASSERT_EQ(testing::run_raystage(
                "simulate black -q --rows 2 --columns 2 --seconds 0.7 --truth-views 0 -o " + take)
                .exit_code,
            0);
  ASSERT_EQ(testing::run_raystage("sync " + take).exit_code, 0);
  const testing::CommandResult result =
      testing::run_raystage("plan epi " + take + " --report " + path("epi.html"));
  EXPECT_EQ(result.exit_code, 4);
  EXPECT_THAT(result.output, HasSubstr("No depth range: only 0 of the pixels have a clear slope"));
}

// docs/planning.md states the results of the examples.
TEST_F(PlanCommand, ArrayOfTheExamples) {
  const std::filesystem::path examples = testing::source_folder() / "examples/arrays";
  for (const auto& [name, columns, rows] :
       {std::tuple{"prototype", 8, 8}, {"cinema_wall", 18, 7}, {"immersive_box", 17, 17}}) {
    const testing::CommandResult result = testing::run_raystage(
        "plan array '" + (examples / (std::string(name) + ".json")).string() +
        "' --json --report " + path("array.html") + " --rig " + path("rig.json"));
    EXPECT_EQ(result.exit_code, 0) << result.output;
    const auto json = nlohmann::json::parse(result.output);
    const auto& best = json["alternatives"][json["best"].get<std::size_t>()];
    EXPECT_EQ(best["columns"], columns) << name;
    EXPECT_EQ(best["rows"], rows) << name;
    EXPECT_THAT(read_file(folder_.path() / "array.html"), HasSubstr("Ghosting against price"));
    EXPECT_EQ(testing::run_raystage("plan resolution -q " + path("rig.json")).exit_code, 0);
  }
  // The last one: its six sides intersect (thesis 6.2).
  const std::string coverage =
      "plan coverage " + path("rig.json") + " --all-directions --shares 100 --subject 0.2,0.2,0 ";
  const testing::CommandResult still =
      testing::run_raystage(coverage + "--transparent-arrays --json --progress none --report " +
                            path("box.html") + " --gltf " + path("box.gltf"));
  ASSERT_EQ(still.exit_code, 0) << still.output;
  const auto json = nlohmann::json::parse(still.output);
  EXPECT_EQ(json["arrays"].size(), 6U);
  EXPECT_EQ(json["subject"]["arrays"], 2);
  const double edge = 0.3;  // of the cube in which the head moves
  EXPECT_NEAR(json["volumes"][0]["volume_m3"], 2 * edge * edge * edge, 0.002);
  EXPECT_THAT(read_file(folder_.path() / "box.html"), HasSubstr("is seen from 33.3 % of all"));
  EXPECT_TRUE(std::filesystem::exists(folder_.path() / "box.gltf"));
  const testing::CommandResult real = testing::run_raystage(coverage);
  EXPECT_EQ(real.exit_code, 0);
  EXPECT_THAT(real.output, HasSubstr("no position was found with 100 % of the rays"));
}

TEST_F(PlanCommand, CoverageOfSeveralRigs) {
  const std::string rigs = "'" + path("rig.json") + "' '" + path("other.json") + "' ";
  ASSERT_EQ(testing::run_raystage("plan array '" + testing::source_folder().string() +
                                  "/examples/arrays/prototype.json' --rig " + path("rig.json"))
                .exit_code,
            0);
  // The second one stands beside the first one.
  auto other = nlohmann::json::parse(read_file(folder_.path() / "rig.json"));
  for (auto& camera : other["cameras"]) {
    auto& x = camera["world_from_camera"][0][3];
    x = x.get<double>() + 0.42;
  }
  write_file_atomically(folder_.path() / "other.json", other.dump());
  const auto extent = [&](const std::string& arguments) {
    const testing::CommandResult result =
        testing::run_raystage("plan coverage --shares 90 --view-fov-deg 40 " + arguments +
                              " --tolerance-mm 4 --json --progress none");
    EXPECT_EQ(result.exit_code, 0) << result.output;
    return nlohmann::json::parse(result.output)["volumes"][0]["extent_m"][0].get<double>();
  };
  EXPECT_GT(extent(rigs), 1.5 * extent(path("rig.json")));
}

// All 16 fisheyes of a real rig: listed as text and as JSON, and drawn from four sides.
TEST_F(PlanCommand, ARealRigIsListedAndDrawn) {
  const auto real = testing::test_data() / "facebook360" / "rig.json";
  if (!std::filesystem::exists(real)) GTEST_SKIP() << "no captured data: " << real.string();
  const auto run = [](const std::string& arguments) {
    const testing::CommandResult result = testing::run_raystage(arguments);
    EXPECT_EQ(result.exit_code, 0) << result.output;
    return result.output;
  };
  run("import '" + real.string() + "' --rig-only -o " + path("real.json"));
  EXPECT_THAT(
      run("info " + path("real.json")),
      AllOf(HasSubstr("Cameras     16, 3360 x 2160 pixels"),
            HasSubstr("Lenses      f-theta, 180 degrees"), HasSubstr("Shutter     global")));
  const auto json = nlohmann::json::parse(run("info --json " + path("real.json")));
  ASSERT_EQ(json["cameras"].size(), 16U);
  for (int i = 0; i < 16; ++i) EXPECT_EQ(json["cameras"][i]["id"], "cam" + std::to_string(i));
  EXPECT_EQ(json["lenses"].size(), 1U);
  EXPECT_EQ(json["lenses"][0]["projection"], "f-theta");
  EXPECT_EQ(json["lenses"][0]["cameras"], 16);
  EXPECT_EQ(json["shutter"]["kind"], "global");

  run("plan coverage " + path("real.json") +
      " --view-fov-deg 60 --focal-depth 3 --shares 90 --tolerance-mm 50 --progress none --report " +
      path("real.html"));
  const std::string page = read_file(folder_.path() / "real.html");
  int drawn = 0;
  for (std::size_t at = 0; (at = page.find("class=\"camera\"", at)) != page.npos; ++at) ++drawn;
  EXPECT_EQ(drawn, 4 * 16);
}

TEST_F(PlanCommand, ArrayThatIsNotSufficientOrWrong) {
  std::string text = read_file(testing::source_folder() / "examples/arrays/prototype.json");
  const auto with = [&](const std::string& from, const std::string& to) {
    std::string changed = text;
    changed.replace(changed.find(from), from.size(), to);
    write_file_atomically(folder_.path() / "array.json", changed);
    return testing::run_raystage("plan array " + path("array.json"));
  };
  EXPECT_EQ(with("\"body_mm\": 40", "\"body_mm\": 80").exit_code, 4);
  const testing::CommandResult narrow = with("[2.8, 2.9957, 4]", "[4]");
  EXPECT_EQ(narrow.exit_code, 2);
  EXPECT_THAT(narrow.output,
              HasSubstr("no camera can be used (webcam-320x240: sees 48.5 x 37.3 deg"));
  EXPECT_EQ(with("[7.99", "[0").exit_code, 2);
  EXPECT_EQ(with("\"largest_fov_deg\": 62", "\"largest_fov_deg\": 60").exit_code, 2);
}

}  // namespace
}  // namespace raystage::cli
