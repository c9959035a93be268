// SPDX-License-Identifier: Apache-2.0
#include "calibrate/lenses_from_take.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <nlohmann/json.hpp>
#include <vector>

#include "base/error.h"
#include "calibrate/lens_report.h"
#include "simulate/simulate.h"
#include "testing/test_folder.h"

namespace raystage::calibrate::lenses_from_take_test {
namespace {

using ::testing::HasSubstr;
using ::testing::Not;

Board chessboard() {
  Board board;
  board.columns = 10;
  board.rows = 7;
  board.square = 0.03;
  return board;
}

/// Returns the message of the error that calibrating this take throws.
std::string error_for(const store::Take& take, const LensesFromTakeOptions& options) {
  try {
    calibrate_lenses(take, BoardDetector(chessboard()), options, [](double) {}, {});
  } catch (const Error& error) {
    return error.what();
  }
  return "";
}

TEST(LensesFromTake, NameUnknownCamerasAndTakesWithoutABoard) {
  const testing::TestFolder folder;
  simulate::SimulationOptions simulation;
  simulation.scene = "white";
  simulation.rows = 1;
  simulation.columns = 2;
  simulation.width = 64;
  simulation.height = 48;
  simulation.fps = 4;
  simulation.seconds = 1;
  simulation.startup_loss_s = 0;
  simulate::simulate(simulation, folder.path() / "take", "test");
  const store::Take take(folder.path() / "take");
  const std::string first = take.document().cameras[0].id;
  LensesFromTakeOptions options;
  options.cameras = {"unknown"};
  EXPECT_THAT(error_for(take, options), HasSubstr("no camera \"unknown\""));
  options.cameras = {first};
  options.shared_prior = {take.document().cameras[1].id};
  EXPECT_THAT(error_for(take, options), HasSubstr("is not among those to calibrate"));
  options.shared_prior = {};
  EXPECT_THAT(error_for(take, options), HasSubstr(first)) << "no board in any frame";
}

TEST(LensesFromTake, OfAFisheyeAreThoseOfTheModelThatExplainsTheBoardBest) {
  const testing::TestFolder folder;
  simulate::SimulationOptions simulation;
  simulation.scene = "board_around";
  simulation.lens = schemas::Projection::kFtheta;
  simulation.horizontal_fov_deg = 200;
  simulation.rows = 1;
  simulation.columns = 1;
  simulation.width = 640;
  simulation.height = 640;
  simulation.fps = 5;
  simulation.seconds = 9;
  simulation.startup_loss_s = 0;
  simulation.truth_views = 0;
  simulate::simulate(simulation, folder.path() / "take", "test");
  const store::Take take(folder.path() / "take");
  const schemas::Intrinsics truth = take.rig().cameras[0].model.intrinsics();
  LensesFromTakeOptions options;
  options.compares_models = true;
  const auto found =
      calibrate_lenses(take, BoardDetector(chessboard()), options, [](double) {}, {});
  ASSERT_EQ(found.size(), 1U);
  ASSERT_TRUE(found[0].comparison);
  const LensCalibration& lens = found[0].calibration;
  EXPECT_EQ(lens.lens.projection, schemas::Projection::kFisheye) << format_lens(found[0]);
  EXPECT_THAT(lens.reasons, ::testing::IsEmpty());
  EXPECT_GE(lens.views, 20);
  EXPECT_LE(lens.rms_px, 0.3);
  EXPECT_NEAR(lens.lens.fx, truth.fx, 0.005 * truth.fx);
  EXPECT_NEAR(lens.lens.cx, truth.cx, 0.5);
  EXPECT_NEAR(lens.lens.cy, truth.cy, 0.5);
  EXPECT_THAT(format_lens(found[0]),
              AllOf(HasSubstr("Model      pinhole"), HasSubstr("Model      fisheye = ftheta"),
                    HasSubstr(": best"), HasSubstr("Lens       fisheye")));
  const auto report = nlohmann::json::parse(lens_report_json(found));
  EXPECT_TRUE(report.at("accepted").get<bool>());
  const auto& camera = report.at("cameras").at(0);
  EXPECT_EQ(camera.at("projection"), "fisheye");
  EXPECT_EQ(camera.at("models").size(), 4U);
  EXPECT_EQ(camera.at("models").at(1).at("rank"), "best");
  EXPECT_EQ(camera.at("lens").at("k1").get<double>(), lens.lens.radial_distortion[0]);

  // Without a choice, the model is that of the rig; a shared prior keeps it.
  options.compares_models = false;
  options.shared_prior = {"all"};
  options.half_angle = 1.9;
  const auto recorded =
      calibrate_lenses(take, BoardDetector(chessboard()), options, [](double) {}, {});
  EXPECT_EQ(recorded[0].calibration.lens.projection, schemas::Projection::kFtheta);
  EXPECT_EQ(recorded[0].calibration.lens.half_angle, 1.9);
  EXPECT_FALSE(recorded[0].comparison);
}

TEST(LensesFromTake, BecomeARigWithoutPosesAndLinesOfText) {
  CameraLens good{"a", 640, 480, {}};
  good.calibration.lens = {620, 621, 322, 238, {}};
  good.calibration.deviations[0] = 0.5;
  good.calibration.rms_px = 0.2;
  CameraLens bad = good;
  bad.id = "b";
  bad.calibration.reasons = {"too few tilts"};
  EXPECT_TRUE(are_accepted({good}));
  EXPECT_FALSE(are_accepted({good, bad}));
  const schemas::RigDocument document = make_lens_document({good, bad});
  EXPECT_FALSE(schemas::is_calibrated(document));
  ASSERT_EQ(document.cameras.size(), 2U);
  EXPECT_EQ(document.cameras[1].geometry.id, "b");
  EXPECT_EQ(document.cameras[1].geometry.intrinsics.fy, 621);
  EXPECT_THAT(format_lens(bad), AllOf(HasSubstr("Camera     b: 0.200 px RMS"),
                                      HasSubstr("Rejected   too few tilts")));
}

TEST(LensesFromTake, BecomeAPage) {
  CameraLens lens{"a<b", 640, 480, {}};
  lens.calibration.lens = {620, 621, 322, 238, {}};
  lens.calibration.deviations[0] = 0.5;
  lens.calibration.rms_px = 0.2;
  lens.calibration.image_coverage = 0.75;
  CameraLens compared = lens;
  compared.id = "c";
  compared.calibration.reasons = {"too few tilts"};
  compared.calibration.rms_px = NAN;
  LensModelComparison& models = compared.comparison.emplace();
  models.fits.resize(2);
  models.fits[0].held_out_rms_px = 0.31;
  models.fits[1].projection = schemas::Projection::kFisheye;
  models.fits[1].failure = "no pose";
  const std::vector<CameraLens> lenses{lens, compared};
  const std::string page = lens_report_html(lenses, "lens.json");
  EXPECT_THAT(page, HasSubstr("1 of 2 lenses are rejected."));
  EXPECT_THAT(page, HasSubstr("c: too few tilts"));
  EXPECT_THAT(page, HasSubstr("a&lt;b"));
  EXPECT_THAT(page, Not(HasSubstr("a<b")));
  EXPECT_THAT(page, HasSubstr("fx 620 &plusmn; 0.5"));
  EXPECT_THAT(page, HasSubstr("<td>0.310</td>"));
  EXPECT_THAT(page, HasSubstr("does not fit: no pose"));
  EXPECT_THAT(lens_report_html({&lens, 1}, "lens.json"), HasSubstr("All lenses are accepted."));
}

}  // namespace
}  // namespace raystage::calibrate::lenses_from_take_test
