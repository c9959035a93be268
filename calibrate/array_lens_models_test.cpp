// SPDX-License-Identifier: Apache-2.0
// The lens model of a simulated array, which its points have to tell.
#include "calibrate/array_lens_models.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <nlohmann/json.hpp>

#include "base/error.h"
#include "calibrate/geometry/calibration_report.h"
#include "testing/calibrate/test_fisheyes.h"

namespace raystage::calibrate::array_lens_models_test {
namespace {

using schemas::Projection;
using ::testing::HasSubstr;

CalibrationOptions options_of(double half_angle_deg) {
  CalibrationOptions options;
  options.scale.spacing_m = 0.2;
  options.solve.lens_models.assign(9,
                                   {Projection::kPinhole, half_angle_deg * testing::kTestDegree});
  return options;
}

TEST(ArrayLensModels, OfWideLensesAreTold) {
  const testing::FisheyeCase test = testing::fisheye_case(Projection::kEquisolid, 100);
  const testing::SyntheticArray array = testing::make_fisheye_array(test, 160, 0.2, 5);
  const ArrayLensModelComparison found =
      compare_array_lens_models(array.detections, options_of(102));
  ASSERT_EQ(found.fits.size(), 4U);
  EXPECT_EQ(found.fits[found.best].projection, Projection::kEquisolid);
  EXPECT_LT(found.fits[found.best].held_out_rms_px, 1);
  EXPECT_TRUE(found.fits[0].is_worse) << "a pinhole sees less than a hemisphere";
  EXPECT_GT(found.held_out, 120);
  const std::string text = format_array_lens_models(found);
  EXPECT_THAT(text, HasSubstr("equisolid"));
  EXPECT_THAT(text, HasSubstr("points held out: best"));
  const auto json = nlohmann::json::parse(with_lens_models_json("{\"a\": 1}", found));
  EXPECT_EQ(json["a"], 1);
  EXPECT_EQ(json["models"][2]["projection"], "equisolid");
  EXPECT_EQ(json["models"][2]["rank"], "best");
  const std::string section = lens_models_html(found);
  EXPECT_THAT(section, HasSubstr(fmt::format("<tr><td>equisolid</td><td>{:.3f}</td><td>best</td>",
                                             found.fits[2].held_out_rms_px)));
  EXPECT_THAT(section, HasSubstr(fmt::format("{} points that were held out", found.held_out)));
  const Calibration calibration =
      calibrate(array.detections, with_lens_model(options_of(102), 9, Projection::kEquisolid));
  EXPECT_THAT(calibration_report_html(calibration, "rig.json", section), HasSubstr(section));
}

TEST(ArrayLensModels, OfPinholesArePinholes) {
  const testing::FisheyeCase narrow{{420, 420, 404, 357, {-0.05, 0.01, 0, 0, 0}}, 45};
  const testing::SyntheticArray array = testing::make_fisheye_array(narrow, 160, 0.2, 6);
  const ArrayLensModelComparison found =
      compare_array_lens_models(array.detections, options_of(60));
  EXPECT_EQ(found.fits[found.best].projection, Projection::kPinhole);
  EXPECT_FALSE(found.fits[0].is_worse);
}

TEST(ArrayLensModels, NeedDetections) {
  const testing::FisheyeCase test = testing::fisheye_case(Projection::kFisheye, 80);
  testing::SyntheticArray array = testing::make_fisheye_array(test, 4, 0.2, 7);
  try {
    compare_array_lens_models(array.detections, options_of(82));
    FAIL() << "four points are enough";
  } catch (const Error& error) {
    EXPECT_THAT(error.what(), HasSubstr("no lens model fits half of the detections"));
  }
}

TEST(ArrayLensModels, KeepHalfAnglesOfFisheyesOnly) {
  const CalibrationOptions options = options_of(90);
  EXPECT_TRUE(with_lens_model(options, 9, Projection::kFisheye).solve.lens_models[3].half_angle);
  EXPECT_FALSE(with_lens_model(options, 9, Projection::kPinhole).solve.lens_models[3].half_angle);
}

}  // namespace
}  // namespace raystage::calibrate::array_lens_models_test
