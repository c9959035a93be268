// SPDX-License-Identifier: Apache-2.0
// Compares lens models by simulated boards.
#include "calibrate/geometry/lens_comparison.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/error.h"
#include "testing/calibrate/test_fisheyes.h"

namespace raystage::calibrate {
namespace {

using schemas::Projection;

class ComparedLensModels : public ::testing::TestWithParam<Projection> {};

testing::FisheyeCase compared_case(Projection projection) {
  if (projection != Projection::kPinhole) {
    const double widest = projection == Projection::kOrthographic ? 80 : 105;
    return testing::fisheye_case(projection, widest);
  }
  testing::FisheyeCase pinhole;
  pinhole.widest_deg = 60;
  pinhole.lens = {420, 420, 407, 355, {-0.05, 0.01, 0, 0, 0}};
  return pinhole;
}

TEST_P(ComparedLensModels, NameTheLensThatRecordedTheBoards) {
  const testing::FisheyeCase test = compared_case(GetParam());
  const CameraBoardViews boards = testing::simulate_boards(test, 16, 0.2, 3);
  const LensModelComparison compared = compare_lens_models(boards, {});
  ASSERT_EQ(compared.fits.size(), 4U);
  const LensModelFit& best = compared.best_fit();
  EXPECT_EQ(best.projection, GetParam());
  EXPECT_EQ(best.calibration.lens.projection, GetParam());
  EXPECT_THAT(best.calibration.reasons, ::testing::IsEmpty());
  EXPECT_FALSE(best.is_worse);
  EXPECT_NEAR(best.held_out_rms_px, 0.2 * std::sqrt(2.0), 0.03);
  EXPECT_LE(best.rms_px, best.held_out_rms_px + 0.01);
  for (const LensModelFit& fit : compared.fits) {
    SCOPED_TRACE(static_cast<int>(fit.projection));
    // A pinhole does not explain boards beside a fisheye.
    if (fit.projection != Projection::kPinhole || GetParam() == Projection::kPinhole) continue;
    EXPECT_TRUE(fit.is_worse);
    if (!fit.failure.empty()) continue;
    EXPECT_GT(fit.bic, best.bic + 10);
    EXPECT_GT(fit.held_out_rms_px, 2 * best.held_out_rms_px);
  }
  EXPECT_EQ(best_common_projection(std::vector{compared, compared}), GetParam());
}

INSTANTIATE_TEST_SUITE_P(All, ComparedLensModels,
                         ::testing::Values(Projection::kPinhole, Projection::kFisheye,
                                           Projection::kEquisolid, Projection::kOrthographic));

TEST(LensComparison, NeedsBoardsToHoldOut) {
  const CameraBoardViews boards =
      testing::simulate_boards(compared_case(Projection::kFisheye), 7, 0.2, 3);
  EXPECT_THROW(compare_lens_models(boards, {}), Error);
}

TEST(LensComparison, ChoosesForAllCamerasWhatNoneContradicts) {
  const auto comparison = [](const std::vector<double>& errors, const std::vector<bool>& is_worse) {
    LensModelComparison result;
    for (std::size_t k = 0; k < errors.size(); ++k) {
      LensModelFit& fit = result.fits.emplace_back();
      fit.projection = compared_projections()[k];
      fit.held_out_rms_px = errors[k];
      fit.is_worse = is_worse[k];
      fit.distortion_px = 10 - static_cast<double>(k);
    }
    return result;
  };
  const auto a = comparison({2, 0.2, 0.21, 0.3}, {true, false, false, true});
  const auto b = comparison({2, 0.21, 0.2, 0.2}, {true, false, false, false});
  EXPECT_EQ(best_common_projection(std::vector{a, b}), Projection::kEquisolid);
  const auto c = comparison({0.2, 0.2, 0.9, 0.9}, {false, true, true, true});
  EXPECT_EQ(best_common_projection(std::vector{a, c}), Projection::kFisheye);
  const auto d = comparison({0.2, 0.2, 0.9, 0.9}, {false, false, true, true});
  EXPECT_EQ(best_common_projection(std::vector{d, d}), Projection::kPinhole);
}

}  // namespace
}  // namespace raystage::calibrate
