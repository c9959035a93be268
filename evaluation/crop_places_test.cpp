// SPDX-License-Identifier: Apache-2.0
#include "evaluation/crop_places.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cmath>
#include <string>

#include "evaluation/evaluation.h"

namespace raystage::evaluation::crop_places_test {
namespace {

using ::testing::ElementsAre;
using ::testing::IsEmpty;
using ::testing::SizeIs;

constexpr double kNaN = std::numeric_limits<double>::quiet_NaN();

CropCandidate candidate(std::size_t view, int x, int y, std::vector<WindowErrors> errors) {
  return {view, {x, y, 96, 96}, std::move(errors)};
}

std::vector<std::size_t> indices(const std::vector<CropPlace>& places) {
  std::vector<std::size_t> all;
  for (const CropPlace& place : places) all.push_back(place.candidate);
  return all;
}

TEST(CropPlaces, EachReasonChoosesInTurn) {
  const std::vector<CropCandidate> candidates{
      candidate(0, 0, 0, {{9, 0, 0}, {9, 0, 0}}),    // both are wrong
      candidate(0, 96, 0, {{2, 0, 0}, {10, 0, 0}}),  // they differ
      candidate(0, 192, 0, {{1, 6, 0}, {1, 4, 0}}),  // edges of depth
      candidate(0, 288, 0, {{1, 0, 2}, {1, 0, 2}}),  // thin structures
      candidate(0, 384, 0, {{3, 0, 0}, {3, 0, 0}})};
  const std::vector<CropPlace> places = choose_crop_places(candidates, 12);
  EXPECT_THAT(indices(places), ElementsAre(1, 0, 2, 3, 4));
  EXPECT_EQ(places[0].reason, CropReason::kDifference);
  EXPECT_EQ(places[1].reason, CropReason::kError);
  EXPECT_EQ(places[2].reason, CropReason::kEdge);
  EXPECT_EQ(places[3].reason, CropReason::kThin);
  EXPECT_EQ(places[4].reason, CropReason::kError);
  EXPECT_THAT(indices(choose_crop_places(candidates, 2)), ElementsAre(1, 0));
  EXPECT_THAT(choose_crop_places(candidates, 0), IsEmpty());
  EXPECT_THAT(choose_crop_places({}, 12), IsEmpty());
}

TEST(CropPlaces, DoNotOverlapInAView) {
  const std::vector<CropCandidate> candidates{
      candidate(0, 0, 0, {{5}}), candidate(0, 95, 95, {{4}}), candidate(0, 96, 0, {{3}}),
      candidate(0, 48, 48, {{6}})};
  EXPECT_THAT(indices(choose_crop_places(candidates, 12)), ElementsAre(3));
  EXPECT_THAT(indices(choose_crop_places(std::span(candidates).first(3), 12)), ElementsAre(0, 2));
}

TEST(CropPlaces, PreferOtherPixelsInOtherViews) {
  const std::vector<CropCandidate> candidates{candidate(0, 0, 0, {{9}}), candidate(1, 0, 0, {{8}}),
                                              candidate(1, 48, 0, {{7}}),
                                              candidate(2, 96, 0, {{2}})};
  // Half of the third window is in the first one: 7 x 0.55 = 3.85; the last one then has 1.1, the
  // second one 8 x 0.1, and it overlaps the third one of its view.
  EXPECT_THAT(indices(choose_crop_places(candidates, 12)), ElementsAre(0, 2, 3));
  // The only windows of their views are all shown.
  EXPECT_THAT(indices(choose_crop_places(std::span(candidates).first(2), 12)), ElementsAre(0, 1));
}

TEST(CropPlaces, PicturesThatHardlyCoverAWindowDoNotCount) {
  const std::vector<CropCandidate> candidates{candidate(0, 0, 0, {{kNaN}, {1}}),
                                              candidate(0, 96, 0, {{kNaN}, {kNaN}}),
                                              candidate(0, 192, 0, {{0}, {0}})};
  const std::vector<CropPlace> places = choose_crop_places(candidates, 12);
  ASSERT_THAT(places, SizeIs(1)) << "neither the covered by none nor the equal ones";
  EXPECT_EQ(places[0].candidate, 0U);
  EXPECT_EQ(places[0].reason, CropReason::kError);
}

TEST(CropPlaces, TiesGoToTheFirst) {
  const std::vector<CropCandidate> candidates(3, candidate(0, 0, 0, {{4}}));
  EXPECT_THAT(indices(choose_crop_places(candidates, 12)), ElementsAre(0));
}

TEST(CropPlaces, WindowsReachTheBorders) {
  const std::vector<Window> windows = windows_of_view(312, 208, 96);
  EXPECT_THAT(windows, SizeIs(6 * 4));
  EXPECT_EQ(windows[1].x, 48);
  EXPECT_EQ(windows[5].x, 312 - 96);
  EXPECT_EQ(windows.back().y, 208 - 96);
  EXPECT_THAT(windows_of_view(96, 96, 96), SizeIs(1));
  const std::vector<Window> small = windows_of_view(64, 120, 96);
  ASSERT_THAT(small, SizeIs(2));
  EXPECT_EQ(small[1].x, 0);
  EXPECT_EQ(small[1].y, 24);
  EXPECT_EQ(small[1].width, 64);
  EXPECT_EQ(small[1].height, 96);
}

TEST(CropPlaces, ErrorsAreThoseOfCoveredPixels) {
  store::RgbImage image(4, 2, 10), truth(4, 2, 10);
  for (int channel = 0; channel < 3; ++channel) {
    image.values[channel] = 16;      // pixel 0: 6 codes
    image.values[3 + channel] = 18;  // pixel 1: 8 codes
  }
  const TruthRegions regions{{1, 0, 0, 0, 0, 0, 0, 0}, {0, 1, 0, 0, 0, 0, 0, 0}, {}};
  std::vector<std::uint8_t> covered{1, 1, 0, 0, 0, 0, 0, 0};
  const std::string id = "v";
  const EvaluatedView view{0, 1, id, image, truth, covered, &regions};
  const WindowErrors two = window_errors(view, {0, 0, 2, 2});
  EXPECT_NEAR(two.rms, std::sqrt((36 + 64) / 2.0), 1e-12);
  EXPECT_NEAR(two.edge, 36 / 4.0, 1e-12);
  EXPECT_NEAR(two.thin, 64 / 4.0, 1e-12);
  EXPECT_TRUE(std::isnan(window_errors(view, {0, 0, 4, 2}).rms)) << "a quarter is covered";
  const WindowErrors unknown = window_errors({0, 1, id, image, truth, covered}, {0, 0, 2, 2});
  EXPECT_EQ(unknown.edge, 0);
  EXPECT_EQ(unknown.thin, 0);
}

}  // namespace
}  // namespace raystage::evaluation::crop_places_test
