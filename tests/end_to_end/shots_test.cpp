// SPDX-License-Identifier: Apache-2.0
// Renders every shot of docs/shots at a reduced size.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <array>
#include <cmath>

#include "compose/exr/exr_file.h"
#include "images/exr_reader.h"
#include "schemas/shot_document.h"
#include "testing/test_folder.h"
#include "testing/test_paths.h"
#include "tests/end_to_end/run_command.h"

namespace raystage {
namespace {

using testing::CommandResult;
using ::testing::HasSubstr;
using testing::run;

const std::filesystem::path kShots = testing::source_folder() / "docs/shots";

class Shots : public ::testing::Test {
 protected:
  /// Makes takes of 16 cameras and 3 s next to copies of the shots; four of 1.2 s around a volume.
  void SetUp() override {
    for (const auto& file : std::filesystem::directory_iterator(kShots)) {
      std::filesystem::copy(file.path(), folder_.path() / file.path().filename());
    }
    const std::string apart = " --spacing-mm 120 --seconds 3";
    const std::string around = " --spacing-mm 150 --seconds 1.2 --fov-deg 105 --k1 0 --k2 0";
    for (const auto& [take, options] :
         {std::array<std::string, 2>{"stage", "stage" + apart},
          {"other", "stage --seed 2" + apart},
          {"actor", "blue_screen" + apart},
          {"ahead", "stage --position 0,0,-0.2" + around},
          {"left", "stage --position=-0.2,0,0 --rotation-deg 90" + around},
          {"behind", "stage --position 0,0,0.2 --rotation-deg 180" + around},
          {"right", "stage --position 0.2,0,0 --rotation-deg -90" + around}}) {
      const CommandResult made = here(
          "raystage simulate " + options +
          " -q --rows 4 --columns 4 --width 160 --height 120 --fps 10 --truth-views 0 -o takes/" +
          take + " && raystage sync -q takes/" + take);
      ASSERT_EQ(made.exit_code, 0) << made.err;
    }
  }
  CommandResult here(const std::string& command) const {
    return run("cd '" + folder_.path().string() + "' && " + command);
  }
  compose::ExrImage rendered(const std::string& shot, const char* number) const {
    return compose::read_exr(folder_.path() / shot / (std::string("f.") + number + ".exr"));
  }
  void check(const std::string& name) const;

  testing::TestFolder folder_;
};

void Shots::check(const std::string& name) const {
  const schemas::ShotDocument shot = schemas::read_shot(kShots / (name + ".json"));
  const CommandResult render =
      here("raystage render -q " + name + ".json --frames 1,24 -o '" + name + "/f.####.exr'");
  ASSERT_EQ(render.exit_code, 0) << render.err;
  const compose::ExrImage first = rendered(name, "0001"), last = rendered(name, "0024");
  ASSERT_EQ(first.width, shot.width);
  double covered = 0, light = 0, difference = 0;
  for (std::size_t i = 0; i < first.rgba.size(); ++i) {
    ASSERT_TRUE(std::isfinite(first.rgba[i]));
    (i % 4 == 3 ? covered : light) += double{first.rgba[i]};
    if (i % 4 != 3) difference += std::abs(double{first.rgba[i]} - double{last.rgba[i]});
  }
  const auto pixels = static_cast<double>(first.width) * first.height;
  EXPECT_GT(covered, 0.9 * pixels);
  EXPECT_GT(light, 3 * 0.05 * pixels);
  EXPECT_GT(difference, 3 * 0.005 * pixels) << "nothing moves";
  if (!shot.camera.stereo) return;
  constexpr images::ExrChannel kRight[] = {{"right.R"}};
  ASSERT_EQ(
      here("raystage render -q " + name + ".json --layout single --frames 1 -o both.exr").exit_code,
      0);
  const CommandResult header = here("exrheader '" + name + "/f.0001.exr'");
  ASSERT_EQ(header.exit_code, 0) << header.err;
  for (const char* line :
       {"name (type string): \"rgba.left\"", "name (type string): \"rgba.right\"",
        "view (type string): \"left\"", "view (type string): \"right\"",
        "framesPerSecond (type rational): 15/1",
        "worldToCamera (type m44f):", "worldToNDC (type m44f):", "timeCode (type timecode):",
        "colorInteropID (type string): \"lin_rec709_scene\"", "capDate (type string):"}) {
    EXPECT_THAT(header.out, HasSubstr(line));
  }
  const auto right = images::read_exr_channels(folder_.path() / "both.exr", kRight, "").values;
  double apart = 0;
  for (std::size_t i = 0; i < right.size(); ++i) {
    apart += std::abs(double{right[i]} - double{first.rgba[4 * i]});
  }
  EXPECT_GT(apart, 0.005 * pixels);
}

TEST_F(Shots, EachRenders) {
  int shots = 0;
  for (const auto& file : std::filesystem::directory_iterator(kShots)) {
    if (file.path().extension() != ".json") continue;
    SCOPED_TRACE(file.path().filename());
    check(file.path().stem());
    ++shots;
  }
  EXPECT_GE(shots, 13);
}

}  // namespace
}  // namespace raystage
