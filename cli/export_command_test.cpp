// SPDX-License-Identifier: Apache-2.0
// raystage export rig, raystage import --rig-only and raystage info of rigs as users run them.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/atomic_file.h"
#include "schemas/rig_document.h"
#include "testing/cli/test_command.h"
#include "testing/store/take_test_data.h"
#include "testing/test_folder.h"

namespace raystage::cli::export_command_test {
namespace {

using ::testing::AllOf;
using ::testing::HasSubstr;
using ::testing::Not;

struct ExportCommand : ::testing::Test {
  ExportCommand() {
    schemas::RigDocument rig;
    rig.name = "ring";
    for (int i = 0; i < 4; ++i) {
      schemas::RigDocument::Camera camera;
      camera.geometry.id = "cam" + std::to_string(i);
      camera.geometry.width = 64;
      camera.geometry.height = 48;
      schemas::Intrinsics& lens = camera.geometry.intrinsics;
      lens.fx = lens.fy = 15;
      lens.cx = 32;
      lens.cy = 24;
      lens.projection = schemas::Projection::kFtheta;
      lens.radial_distortion = {-0.03, 1e-3, 0, 0};
      lens.half_angle = 1.57079632679;
      camera.geometry.world_from_camera[3] = 0.25 * i;
      rig.cameras.push_back(camera);
    }
    schemas::write_rig(rig, folder.path() / "ring.json");
  }
  testing::CommandResult run(const std::string& arguments) const {
    const std::filesystem::path before = std::filesystem::current_path();
    std::filesystem::current_path(folder.path());
    const testing::CommandResult result = testing::run_raystage(arguments);
    std::filesystem::current_path(before);
    return result;
  }
  testing::TestFolder folder;
};

TEST_F(ExportCommand, WritesARigThatImportReads) {
  for (const std::string format : {"facebook360", "google", "colmap", "nerf"}) {
    SCOPED_TRACE(format);
    const auto exported = run("export rig ring.json --format " + format + " -o out_" + format);
    EXPECT_EQ(exported.exit_code, 0) << exported.output;
    EXPECT_THAT(exported.output, HasSubstr("out_" + format + ": 4 cameras"));
    EXPECT_EQ(exported.output.find("note: the half angles of 4 cameras are not in the file") ==
                  std::string::npos,
              format == "facebook360");
    const std::string back = format + ".json";
    const auto imported = run("import out_" + format + " --rig-only -o " + back);
    EXPECT_EQ(imported.exit_code, 0) << imported.output;
    EXPECT_THAT(imported.output, HasSubstr(back + ": a rig with 4 cameras"));
    const schemas::RigDocument rig = schemas::read_rig(folder.path() / back);
    EXPECT_EQ(rig.cameras.at(3).geometry.id, "cam3");
    EXPECT_EQ(rig.cameras.at(3).geometry.intrinsics.radial_distortion[0], -0.03);
  }
}

TEST_F(ExportCommand, InfoOfARigStatesItsLenses) {
  const auto text = run("info ring.json");
  EXPECT_EQ(text.exit_code, 0) << text.output;
  EXPECT_THAT(text.output, AllOf(HasSubstr("Cameras     4, 64 x 48 pixels, 0.25 m apart\n"),
                                 HasSubstr("Lenses      f-theta, 180 degrees\n")));
  const auto json = nlohmann::json::parse(run("info ring.json --json").output);
  EXPECT_EQ(json["lenses"][0]["projection"], "f-theta");
  EXPECT_EQ(json["lenses"][0]["cameras"], 4);
  EXPECT_NEAR(json["lenses"][0]["max_fov_deg"].get<double>(), 180, 1e-6);
}

TEST_F(ExportCommand, InfoOfARigStatesItsShutters) {
  EXPECT_THAT(run("info ring.json").output, HasSubstr("Shutter     global ("));
  EXPECT_EQ(nlohmann::json::parse(run("info ring.json --json").output)["shutter"]["kind"],
            "global");
  schemas::RigDocument rig = schemas::read_rig(folder.path() / "ring.json");
  rig.cameras[2].geometry.line_time_us = 31.25;
  schemas::write_rig(rig, folder.path() / "rolling.json");
  EXPECT_THAT(
      run("info rolling.json").output,
      HasSubstr("Shutter     rolling in 1 of 4 cameras: line time 31.25 us, read-out 1.5 ms "
                "a frame (rig.json)\n"));
  const auto shutter = nlohmann::json::parse(run("info rolling.json --json").output)["shutter"];
  EXPECT_EQ(shutter, (nlohmann::json{{"kind", "rolling"},
                                     {"rolling_cameras", 1},
                                     {"line_time_us", {31.25, 31.25}},
                                     {"read_out_ms", {1.5, 1.5}}}));
}

TEST_F(ExportCommand, ATakesRigIsWritten) {
  const auto take = folder.path() / "take";
  testing::write_take(take, {{0, 1'000'000}, {0, 1'000'000}}, 20);
  const auto result = run("export rig take --format colmap -o model");
  EXPECT_EQ(result.exit_code, 0) << result.output;
  EXPECT_THAT(read_file(folder.path() / "model" / "cameras.txt"), HasSubstr("1 PINHOLE"));
  EXPECT_THAT(run("info take").output, HasSubstr("Lenses      pinhole, "));
}

TEST_F(ExportCommand, RefusesToReplaceFilesAndUnknownFormats) {
  const std::string before = read_file(folder.path() / "ring.json");
  const auto onto = run("export rig ring.json --format nerf -o ring.json");
  EXPECT_EQ(onto.exit_code, 2);
  EXPECT_THAT(onto.output, HasSubstr("would replace the rig"));
  std::filesystem::create_directory(folder.path() / "take");
  std::filesystem::copy(folder.path() / "ring.json", folder.path() / "take" / "rig.json");
  EXPECT_EQ(run("export rig take --format nerf -o take/rig.json").exit_code, 2);
  ASSERT_EQ(run("export rig ring.json --format facebook360 -o rig.json").exit_code, 0);
  const auto exists = run("import rig.json --rig-only -o rig.json");
  EXPECT_EQ(exists.exit_code, 2);
  EXPECT_THAT(exists.output, HasSubstr("exists"));
  EXPECT_EQ(read_file(folder.path() / "ring.json"), before);
  EXPECT_EQ(run("export rig ring.json --format maya -o x").exit_code, 2);
  EXPECT_EQ(run("export").exit_code, 2);
  EXPECT_THAT(run("import ring.json --rig-only -o x.json").output, Not(HasSubstr("a rig with")));
}

TEST_F(ExportCommand, NamesTheOptionForPictures) {
  ASSERT_EQ(run("export rig ring.json --format facebook360 -o rig.json").exit_code, 0);
  const auto result = run("import rig.json -o take");
  EXPECT_EQ(result.exit_code, 2);
  EXPECT_THAT(result.output, AllOf(HasSubstr("rig.json#/cameras/0"), HasSubstr("--images")));
}

}  // namespace
}  // namespace raystage::cli::export_command_test
