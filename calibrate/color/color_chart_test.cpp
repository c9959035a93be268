// SPDX-License-Identifier: Apache-2.0
#include "calibrate/color/color_chart.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

namespace raystage::calibrate {
namespace {

using ::testing::ElementsAre;
using ::testing::HasSubstr;
using ::testing::IsEmpty;

constexpr rig::PictureSize kPicture{640, 480};

schemas::PhotometricResponse mixing(double by) {
  schemas::PhotometricResponse response;
  response.matrix =
      rig::inverse({{{1 - 2 * by, by, by}, {by / 2, 1 - by, by / 2}, {0, by, 1 - by}}});
  response.vignetting = schemas::Vignetting{320, 240, {0.2, 0.05, 0}};
  return response;
}

/// Returns the measurement by a camera of a chart in the lower left of its picture.
ChartMeasurement measured_chart(const schemas::PhotometricResponse& response) {
  ChartMeasurement measurement;
  measurement.frames = 1;
  measurement.size = kPicture;
  const rig::PatchColors light = rig::color_checker_reference();
  for (int p = 0; p < rig::kChartPatches; ++p) {
    ChartMeasurement::Patch& patch = measurement.patches[p];
    const int row = p / rig::kChartColumns, column = p % rig::kChartColumns;
    patch.x = 40.5 + 50 * column;
    patch.y = 250.5 + 50 * row;
    schemas::Rgb lit = light[p];
    for (double& channel : lit) channel *= 0.7;
    patch.measured = rig::invert_photometric_correction(
        response, kPicture, static_cast<int>(patch.x), static_cast<int>(patch.y), lit);
  }
  return measurement;
}

void expect_matrix(const schemas::ColorMatrix& found, const schemas::ColorMatrix& expected) {
  for (std::size_t row = 0; row < 3; ++row) {
    for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(found[row][c], expected[row][c], 1e-3);
  }
}

/// Returns the response with an identity matrix.
schemas::PhotometricResponse unmixed(schemas::PhotometricResponse response) {
  response.matrix = schemas::kIdentityColorMatrix;
  return response;
}

TEST(ColorChart, FindsWhatChannelsSeeOfEachOther) {
  const schemas::PhotometricResponse one = mixing(0.02), other = mixing(0.15);
  const ColorMatch found = match_charts({measured_chart(one), measured_chart(other)},
                                        {unmixed(one), unmixed(other)}, {"a", "b"}, {1, true});
  EXPECT_THAT(found.reasons, IsEmpty());
  // The brightness is that of the second camera's greys, which are slightly coloured and therefore
  // shift with the crosstalk.
  const double scale = found.responses[1].matrix[1][1] / other.matrix[1][1];
  EXPECT_NEAR(scale, 1, 0.005);
  for (std::size_t camera : {0U, 1U}) {
    schemas::ColorMatrix matrix = found.responses[camera].matrix;
    for (schemas::Rgb& row : matrix) {
      for (double& channel : row) channel /= scale;
    }
    expect_matrix(matrix, (camera == 0 ? one : other).matrix);
  }
  EXPECT_GT(found.before.mean_difference, 2);
  EXPECT_LT(found.after.mean_difference, 0.1);
}

TEST(ColorChart, MakesCamerasAlikeToTheReferenceCamera) {
  const schemas::PhotometricResponse one = mixing(0.02), other = mixing(0.15);
  const ColorMatch found = match_charts({measured_chart(one), measured_chart(other)},
                                        {unmixed(one), unmixed(other)}, {"a", "b"}, {});
  EXPECT_EQ(found.responses[0], unmixed(one));
  const schemas::Rgb light{0.5, 0.1, 0.3};
  const schemas::Rgb measured = rig::apply_photometric_correction(
      found.responses[0], kPicture, 9, 9,
      rig::invert_photometric_correction(one, kPicture, 9, 9, light));
  const schemas::Rgb made = rig::apply_photometric_correction(
      found.responses[1], kPicture, 9, 9,
      rig::invert_photometric_correction(other, kPicture, 9, 9, light));
  for (std::size_t c = 0; c < 3; ++c) EXPECT_NEAR(made[c], measured[c], 1e-3);
}

TEST(ColorChart, FindsBlackOnlyWhereNothingIsKnownOfIt) {
  schemas::PhotometricResponse foggy = mixing(0.1);
  foggy.vignetting.reset();
  foggy.brightness = {-0.02, -0.03, -0.01};
  schemas::PhotometricResponse nothing_known, contrast_known;
  contrast_known.contrast = {1.01, 1, 1};
  const ColorMatch found =
      match_charts({measured_chart({}), measured_chart(foggy), measured_chart(foggy)},
                   {{}, nothing_known, contrast_known}, {"a", "b", "c"}, {});
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(found.responses[1].brightness[c], foggy.brightness[c], 1e-3);
  }
  EXPECT_EQ(found.responses[2].brightness, schemas::Rgb{});
}

TEST(ColorChart, FindsTheReferenceCamerasBlackTooWherePublishedColoursTellIt) {
  schemas::PhotometricResponse foggy = mixing(0.1);
  foggy.vignetting.reset();
  foggy.brightness = {-0.02, -0.03, -0.01};
  const ColorMatch found = match_charts({measured_chart(foggy)}, {{}}, {"a"}, {0, true});
  EXPECT_THAT(found.reasons, IsEmpty());
  for (std::size_t c = 0; c < 3; ++c) {
    EXPECT_NEAR(found.responses[0].brightness[c], foggy.brightness[c], 2e-3);
  }
}

TEST(ColorChart, DoesWithoutPatchesThatAreOverexposed) {
  const schemas::PhotometricResponse other = mixing(0.1);
  std::vector<ChartMeasurement> measurements{measured_chart({}), measured_chart(other)};
  for (const std::size_t patch : {18U, 15U, 11U}) {
    measurements[1].patches[patch].measured = {1, 1, 1};
    measurements[1].patches[patch].is_exposed = false;
  }
  const ColorMatch found = match_charts(measurements, {{}, unmixed(other)}, {"a", "b"}, {});
  EXPECT_THAT(found.reasons, IsEmpty());
  expect_matrix(found.responses[1].matrix, other.matrix);
  for (ChartMeasurement::Patch& patch : measurements[1].patches) patch.is_exposed = false;
  EXPECT_THAT(match_charts(measurements, {{}, unmixed(other)}, {"a", "b"}, {}).reasons,
              ElementsAre(HasSubstr("overexposed or too dark in b")));
}

TEST(ColorChart, OneCameraHasItsPublishedColours) {
  const schemas::PhotometricResponse only = mixing(0.1);
  const ColorMatch found = match_charts({measured_chart(only)}, {unmixed(only)}, {"a"}, {0, true});
  EXPECT_THAT(found.reasons, IsEmpty());
  EXPECT_LT(found.after.mean_difference, 0.1);
  EXPECT_EQ(found.after.deviation, schemas::Rgb{});
}

TEST(ColorChart, OneCameraOfManyThatIsWrongIsNamed) {
  const schemas::PhotometricResponse right = mixing(0.1);
  std::vector<ChartMeasurement> measurements(16, measured_chart(right));
  std::vector<std::string> names;
  for (std::size_t i = 0; i < measurements.size(); ++i) names.push_back("c" + std::to_string(i));
  std::ranges::reverse(measurements[11].patches);  // upside down
  const ColorMatch found =
      match_charts(measurements, std::vector(16, unmixed(right)), names, {0, false});
  EXPECT_THAT(found.reasons, ElementsAre(HasSubstr("from the chart in c11:")));
  ASSERT_EQ(found.fits.size(), 16U);
  EXPECT_LT(found.fits[3].mean_difference, 0.1);
  EXPECT_GT(found.fits[11].mean_difference, 4);
  EXPECT_EQ(found.fits[11].inliers, rig::kChartPatches);
  // No patch of camera 11 is usable, and its contrast is known already.
  for (ChartMeasurement::Patch& patch : measurements[11].patches) patch.is_exposed = false;
  std::vector<schemas::PhotometricResponse> known(16, unmixed(right));
  for (schemas::PhotometricResponse& response : known) response.contrast = {1.01, 1, 1};
  const ColorMatch unexposed = match_charts(measurements, known, names, {0, true});
  EXPECT_THAT(unexposed.reasons, ElementsAre(HasSubstr("too dark in c11:")));
  EXPECT_EQ(unexposed.responses[11], known[11]);
  EXPECT_TRUE(std::isfinite(unexposed.after.mean_difference));
}

TEST(ColorChart, LeavesCamerasThatDidNotFindItAsTheyAre) {
  const std::vector<schemas::PhotometricResponse> known{mixing(0.1), mixing(0.2)};
  std::vector<ChartMeasurement> measurements{measured_chart(known[0]), {}};
  const ColorMatch found = match_charts(measurements, known, {"a", "b"}, {0, true});
  EXPECT_THAT(found.reasons, ElementsAre(HasSubstr("not found by b")));
  EXPECT_EQ(found.responses[1], known[1]);
  const ColorMatch blind = match_charts(measurements, known, {"a", "b"}, {1, true});
  EXPECT_EQ(blind.responses, known);
}

}  // namespace
}  // namespace raystage::calibrate
