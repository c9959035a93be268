// SPDX-License-Identifier: Apache-2.0
// Compares what `raystage plan check` computes with what `raystage render` renders.
#include <fmt/format.h>
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <cmath>
#include <fstream>
#include <nlohmann/json.hpp>
#include <random>
#include <string>

#include "compose/exr/exr_file.h"
#include "testing/test_data.h"
#include "testing/test_folder.h"
#include "tests/end_to_end/run_command.h"

namespace raystage {
namespace {

using nlohmann::json;
using testing::CommandResult;
using ::testing::HasSubstr;
using testing::run;

class PlanCheck : public ::testing::Test {
 protected:
  std::string path(const std::string& name) const {
    return "'" + (folder_.path() / name).string() + "'";
  }
  /// Writes a shot of the folder's take with a key of the camera for each frame.
  void write_shot(const json& keys, const json& focal_plane, int width = 640, int height = 480) {
    const json shot{{"schema", "raystage/shot/3"},
                    {"width", width},
                    {"height", height},
                    {"fps", 15},
                    {"first_frame", 1},
                    {"last_frame", keys.size()},
                    {"camera", {{"keys", keys}}},
                    {"layers",
                     {{{"take", "take"},
                       {"method", "focal_plane"},
                       {"focal_plane", focal_plane},
                       {"speed", 0}}}},
                    {"output", {{"compression", "zip"}}}};
    std::ofstream(folder_.path() / "shot.json") << shot;
  }
  json check(const std::string& options = "") const {
    const CommandResult result =
        run("raystage plan check " + path("shot.json") + " --json " + options);
    EXPECT_EQ(result.exit_code, 0) << result.err;
    return json::parse(result.out);
  }
  compose::ExrImage rendered(int frame) const {
    return compose::read_exr(folder_.path() / "out" / fmt::format("f.{:04}.exr", frame));
  }
  void render() const {
    const CommandResult result =
        run("raystage render " + path("shot.json") + " -q --existing overwrite -o '" +
            folder_.path().string() + "/out/f.####.exr'");
    ASSERT_EQ(result.exit_code, 0) << result.err;
  }

  /// Renders 20 random views around `centre` and compares the transparent pixels.
  void compare_shares(const std::array<double, 3>& centre, double reach, double depth) {
    std::mt19937 random(7);
    std::uniform_real_distribution<double> any(-1, 1);
    json keys = json::array();
    for (int frame = 1; frame <= 20; ++frame) {
      const double x = centre[0] + reach * any(random), y = centre[1] + reach * any(random),
                   z = centre[2] + 1.5 * reach * any(random);
      keys.push_back({{"frame", frame},
                      {"position", {x, y, z}},
                      {"target",
                       {centre[0] + 0.3 * depth * any(random),
                        centre[1] + 0.2 * depth * any(random), centre[2] - depth}},
                      {"horizontal_fov_deg", 40 + 15 * any(random)}});
    }
    // With fewer pixels than the cameras have, several rays make a pixel, and it is transparent
    // only where all of them lack.
    constexpr int kWidth = 1280, kHeight = 960;
    write_shot(keys, {{"depth_m", depth}}, kWidth, kHeight);
    const json checked = check();
    render();
    int partial = 0;
    double worst = 0;
    for (int frame = 1; frame <= 20; ++frame) {
      const compose::ExrImage image = rendered(frame);
      double transparent = 0;
      for (std::size_t i = 3; i < image.rgba.size(); i += 4)
        transparent += image.rgba[i] == 0 ? 1 : 0;
      transparent /= kWidth * kHeight;
      const double share =
          checked.at("layers")[0].at("frames")[frame - 1].at("unrecorded_share").get<double>();
      EXPECT_NEAR(share, transparent, 5e-4) << "frame " << frame;
      worst = std::max(worst, std::abs(share - transparent));
      partial += transparent > 0.001 && transparent < 0.999 ? 1 : 0;
    }
    EXPECT_GE(partial, 8) << "the views lack some rays";
    RecordProperty("worst", std::to_string(worst));
  }

  testing::TestFolder folder_;
};

TEST_F(PlanCheck, SharesOfASimulatedTakeAreThoseOfTheRender) {
  ASSERT_EQ(
      run("raystage simulate stage -q --rows 8 --columns 8 --width 160 --height 120 --seconds 0.6 "
          "--truth-views 0 -o " +
          path("take") + " && raystage sync -q " + path("take"))
          .exit_code,
      0);
  compare_shares({0, 0, 0}, 0.2, 3.5);
}

TEST_F(PlanCheck, SharesOfACapturedTakeAreThoseOfTheRender) {
  const auto data = testing::find_captured_data("shop");
  if (!data) GTEST_SKIP() << "no captured light field shop";
  ASSERT_EQ(
      run("raystage import '" + data->string() + "/import.json' -q -o " + path("take")).exit_code,
      0);
  const json rig = json::parse(std::ifstream(folder_.path() / "take" / "rig.json"));
  std::array<double, 3> centre{};
  for (const json& camera : rig.at("cameras")) {
    for (std::size_t axis = 0; axis < 3; ++axis) {
      centre[axis] += camera.at("world_from_camera")[axis][3].get<double>() /
                      static_cast<double>(rig.at("cameras").size());
    }
  }
  compare_shares(centre, 0.15, 3);
}

}  // namespace
}  // namespace raystage
