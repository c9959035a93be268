// SPDX-License-Identifier: Apache-2.0
#include "calibrate/color_from_takes.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "simulate/simulate.h"
#include "testing/test_folder.h"

namespace raystage::calibrate::color_from_takes_test {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;

void no_progress(double) {}

class ColorFromTakesTest : public ::testing::Test {
 protected:
  std::filesystem::path take(const std::string& scene, int columns = 2) {
    simulate::SimulationOptions settings;
    settings.scene = scene;
    settings.rows = 1;
    settings.columns = columns;
    settings.width = 96;
    settings.height = 72;
    settings.fps = 4;
    settings.seconds = 1;
    settings.startup_loss_s = 0;
    settings.photometric_deviation = 0.1;
    const std::filesystem::path path = folder_.path() / (scene + std::to_string(columns));
    if (!std::filesystem::exists(path)) simulate::simulate(settings, path, "test");
    return path;
  }

  Error error_for(const ColorFromTakesOptions& settings, const std::filesystem::path& rig_file) {
    try {
      calibrate_color(settings, schemas::read_rig(rig_file), rig_file, no_progress, {});
    } catch (const Error& error) {
      return error;
    }
    ADD_FAILURE() << "no error";
    return Error::failed("", "", "");
  }

 private:
  testing::TestFolder folder_;
};

TEST_F(ColorFromTakesTest, TargetsGiveEachCameraOfTheRigItsResponse) {
  ColorFromTakesOptions settings;
  settings.targets = {take("white"), take("grey"), take("black")};
  settings.reference = "r0c1";
  const std::filesystem::path rig_file = take("white") / "rig.json";
  const schemas::RigDocument rig = schemas::read_rig(rig_file);
  const ColorFromTakes found = calibrate_color(settings, rig, rig_file, no_progress, {});
  EXPECT_EQ(found.reference_id(), "r0c1");
  ASSERT_EQ(found.steps.size(), 1U);
  EXPECT_TRUE(found.is_accepted());
  const schemas::RigDocument corrected = with_color_responses(rig, rig_file, found);
  EXPECT_EQ(corrected.cameras[1].photometric.contrast, (schemas::Rgb{1, 1, 1})) << "the reference";
  EXPECT_NE(corrected.cameras[0].photometric.contrast, (schemas::Rgb{1, 1, 1}));
  EXPECT_EQ(corrected.cameras[0].photometric.contrast, found.steps[0].responses[0].contrast);
  schemas::RigDocument larger = rig;
  larger.cameras.push_back(rig.cameras[0]);
  larger.cameras.back().geometry.id = "spare";
  EXPECT_THROW(with_color_responses(larger, rig_file, found), Error);
}

TEST_F(ColorFromTakesTest, NamesTheSettingOfEachContradiction) {
  const std::filesystem::path rig_file = take("white") / "rig.json";
  ColorFromTakesOptions settings;
  EXPECT_THAT(error_for(settings, rig_file).settings(), ElementsAre("chart", "scene"));
  settings.targets = {take("white"), take("grey")};
  settings.reference = "unknown";
  EXPECT_THAT(error_for(settings, rig_file).settings(), ElementsAre("reference"));
  settings.reference = "";
  settings.exposures = {1};
  EXPECT_THAT(error_for(settings, rig_file).what(), HasSubstr("1 exposures for 2 takes"));
  settings.exposures = {1, 4};
  EXPECT_THAT(error_for(settings, rig_file).settings(), ElementsAre("exposures"));
  settings.exposures = {};
  settings.dark = take("black", 3);
  EXPECT_THAT(error_for(settings, rig_file).what(), HasSubstr("other cameras than the first"));
}

TEST_F(ColorFromTakesTest, ScenesNeedDepthsThatContainSomething) {
  const std::filesystem::path rig_file = take("stage") / "rig.json";
  ColorFromTakesOptions settings;
  settings.scene = take("stage");
  settings.depths = {3, 2};
  EXPECT_THAT(error_for(settings, rig_file).settings(), ElementsAre("near", "far", "focal_depth"));
}

}  // namespace
}  // namespace raystage::calibrate::color_from_takes_test
