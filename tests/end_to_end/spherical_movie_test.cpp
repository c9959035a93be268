// SPDX-License-Identifier: Apache-2.0
// Renders all directions of a take for both eyes, and reads the movie of the frames by ffprobe.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "testing/test_folder.h"
#include "tests/end_to_end/run_command.h"

namespace raystage {
namespace {

using nlohmann::json;
using testing::CommandResult;
using ::testing::HasSubstr;
using testing::run;

class SphericalMovie : public ::testing::Test {
 protected:
  void SetUp() override {
    const CommandResult made = here(
        "raystage simulate stage -q --rows 2 --columns 2 --width 96 --height 72 --fps 10 "
        "--fov-deg 90 --seconds 1.2 --truth-views 0 -o take && raystage sync -q take");
    ASSERT_EQ(made.exit_code, 0) << made.err;
    testing::write_text(folder_.path() / "shot.json", R"({
"schema": "raystage/shot/3", "name": "all around", "width": 128, "height": 64, "fps": 24,
"first_frame": 1, "last_frame": 2,
"camera": {"projection": "equirectangular", "stereo": {"interaxial_m": 0.03},
           "keys": [{"frame": 1, "position": [0, 0, 0]}]},
"layers": [{"take": "take", "method": "lumigraph", "focal_plane": {"depth_m": 4}}]})");
  }
  CommandResult here(const std::string& command) const {
    return run("cd '" + folder_.path().string() + "' && " + command);
  }
  /// Returns the side data of the movie's stream, by its type.
  std::map<std::string, json> side_data(const std::string& movie) const {
    const CommandResult shown = here("ffprobe -v error -show_streams -of json " + movie);
    EXPECT_EQ(shown.exit_code, 0) << shown.err;
    std::map<std::string, json> found;
    const json stream = json::parse(shown.out)["streams"][0];
    for (const json& data : stream.value("side_data_list", json::array())) {
      found[data["side_data_type"]] = data;
    }
    found["size"] = {{"width", stream["width"]}, {"height", stream["height"]}};
    return found;
  }
  testing::TestFolder folder_;
};

TEST_F(SphericalMovie, PlayersAreToldHowToShowIt) {
  if (run("ffprobe -version").exit_code != 0) GTEST_SKIP() << "there is no ffprobe";
  const CommandResult rendered = here("raystage render -q shot.json -o f.####.exr");
  ASSERT_TRUE(rendered.exit_code == 0 || rendered.exit_code == 4) << rendered.err;
  for (const char* movie : {"both.mp4", "both.mkv"}) {
    ASSERT_EQ(here("raystage preview -q f.####.exr --stereo top-bottom -o " + std::string(movie))
                  .exit_code,
              0);
    auto data = side_data(movie);
    EXPECT_EQ(data["Spherical Mapping"]["projection"], "equirectangular") << movie;
    EXPECT_EQ(data["Stereo 3D"]["type"], "top and bottom") << movie;
    EXPECT_EQ(data["size"]["height"], 128);
  }
  ASSERT_EQ(here("raystage preview -q f.####.exr --stereo side-by-side -o both.mp4").exit_code, 0);
  EXPECT_EQ(side_data("both.mp4")["Stereo 3D"]["type"], "side by side");
  ASSERT_EQ(here("raystage preview -q f.####.exr -o left.mp4").exit_code, 0);
  auto left = side_data("left.mp4");
  EXPECT_EQ(left["Spherical Mapping"]["projection"], "equirectangular");
  EXPECT_FALSE(left.contains("Stereo 3D"));
  EXPECT_EQ(left["size"]["height"], 64);
  EXPECT_EQ(here("raystage preview -q f.####.exr -o left.mov").exit_code, 0);
  const CommandResult refused =
      here("raystage preview -q f.####.exr --stereo top-bottom -o both.mov");
  EXPECT_EQ(refused.exit_code, 2);
  EXPECT_THAT(refused.err, HasSubstr("a .mov file cannot say"));
}

TEST_F(SphericalMovie, OtherProgramsReadTheProjection) {
  if (run("oiiotool --version").exit_code != 0) GTEST_SKIP() << "there is no oiiotool";
  const CommandResult rendered = here("raystage render -q shot.json --frames 1 -o f.####.exr");
  ASSERT_TRUE(rendered.exit_code == 0 || rendered.exit_code == 4) << rendered.err;
  EXPECT_THAT(here("oiiotool --info -v f.0001.exr").out, HasSubstr("LatLong Environment"));
}

TEST_F(SphericalMovie, DoorsForOtherCamerasSayWhy) {
  const CommandResult camera = here("raystage camera shot.json -o c.nk");
  EXPECT_EQ(camera.exit_code, 2);
  EXPECT_THAT(camera.err, HasSubstr("no lens that these files could hold"));
  const CommandResult confidence = here("raystage render -q shot.json --confidence -o f.####.exr");
  EXPECT_EQ(confidence.exit_code, 2);
  EXPECT_THAT(confidence.err, HasSubstr("lf.confidence is not measured"));
  const CommandResult filled = here("raystage render -q shot.json --fill push-pull -o f.####.exr");
  EXPECT_EQ(filled.exit_code, 2);
  EXPECT_THAT(filled.err, HasSubstr("are not filled"));
}

}  // namespace
}  // namespace raystage
