// SPDX-License-Identifier: Apache-2.0
#include "calibrate/lenses_from_take.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "calibrate/lens_report.h"
#include "simulate/simulate.h"
#include "testing/test_folder.h"

namespace raystage::calibrate::lenses_from_take_test {
namespace {

using ::testing::HasSubstr;

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

}  // namespace
}  // namespace raystage::calibrate::lenses_from_take_test
