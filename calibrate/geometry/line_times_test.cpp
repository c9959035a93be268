// SPDX-License-Identifier: Apache-2.0
#include "calibrate/geometry/line_times.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

namespace raystage::calibrate {
namespace {

using ::testing::HasSubstr;
using Source = LineTimes::Source;

/// Four cameras of 480 rows, whose line times have this common and this independent deviation.
struct FourCameras : ::testing::Test {
  FourCameras() {
    for (const char* id : {"a", "b", "c", "d"}) {
      ArrayModel::Camera camera;
      camera.id = id;
      camera.width = 640;
      camera.height = 480;
      model.cameras.push_back(camera);
    }
    correction.line_cameras = {0, 1, 2, 3};
    correction.line_covariance = Eigen::MatrixXd::Constant(4, 4, 0.3 * 0.3);
    correction.line_covariance.diagonal().array() += 0.1 * 0.1;
  }
  LineTimes chosen(const std::vector<double>& change) {
    correction.line_time_us = change;
    return choose_line_times(model, used, given, correction);
  }

  ArrayModel model;
  std::vector<double> used{0, 0, 0, 0};
  std::vector<bool> given{false, false, false, false};
  TimeCorrection correction;
};

TEST_F(FourCameras, HaveOneValueIfTheyAgree) {
  used = {10, 10, 10, 10};
  const LineTimes found = chosen({20.1, 19.9, 20.1, 19.9});
  for (const LineTimes::Camera& camera : found.cameras) {
    EXPECT_EQ(camera.source, Source::kFoundCommon);
    EXPECT_NEAR(camera.us, 30, 1e-9);
    EXPECT_NEAR(camera.deviation_us, std::sqrt(0.09 + 0.01 / 4), 1e-9);
  }
  EXPECT_TRUE(found.is_any_found());
  EXPECT_THAT(format_line_times(found, model),
              HasSubstr("4 cameras: rolling, one value found, line time 30 +- 0.3 us (one sigma), "
                        "read-out 14.4 ms a frame"));
}

TEST_F(FourCameras, HaveTheirOwnIfTheyDiffer) {
  const LineTimes found = chosen({30, 10, 30, 0.9});
  EXPECT_EQ(found.cameras[1].source, Source::kFound);
  EXPECT_EQ(found.cameras[1].us, 10);
  EXPECT_NEAR(found.cameras[1].deviation_us, std::sqrt(0.1), 1e-9);
  EXPECT_EQ(found.cameras[3].source, Source::kInsignificant);
  EXPECT_EQ(found.cameras[3].us, 0);
  EXPECT_EQ(found.cameras[3].estimate_us, 0.9);
}

// Frames of another size come from other cameras.
TEST_F(FourCameras, OfAnotherSizeAreAGroupOfTheirOwn) {
  model.cameras[2].height = model.cameras[3].height = 960;
  const LineTimes found = chosen({30, 30, 12, 12});
  EXPECT_NEAR(found.cameras[0].us, 30, 1e-9);
  EXPECT_NEAR(found.cameras[3].us, 12, 1e-9);
  EXPECT_EQ(found.cameras[3].source, Source::kFoundCommon);
}

TEST_F(FourCameras, AreGlobalIfTheEstimateIsNotSignificant) {
  for (const LineTimes::Camera& camera : chosen({1.2, 1.2, 1.2, 1.2}).cameras) {
    EXPECT_EQ(camera.source, Source::kInsignificant);
    EXPECT_EQ(camera.us, 0);
  }
  // Significant, but the read-out takes 0.48 ms.
  correction.line_covariance *= 1e-4;
  EXPECT_EQ(chosen({1, 1, 1, 1}).cameras[0].us, 0);
}

TEST_F(FourCameras, KeepWhatIsGiven) {
  used = {25, 0, 0, 0};
  given[0] = true;
  correction.line_cameras = {1, 2, 3};
  correction.line_covariance = correction.line_covariance.topLeftCorner(3, 3).eval();
  const LineTimes found = chosen({0, 30, 30, 30});
  EXPECT_EQ(found.cameras[0].source, Source::kGiven);
  EXPECT_EQ(found.cameras[0].us, 25);
  EXPECT_NEAR(found.cameras[1].us, 30, 1e-9);
}

}  // namespace
}  // namespace raystage::calibrate
