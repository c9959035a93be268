// SPDX-License-Identifier: Apache-2.0
#include "evaluation/shot_errors.h"

#include <gtest/gtest.h>

#include <cmath>

namespace raystage::evaluation {
namespace {

store::RgbImage grey(int width, int height, std::uint8_t code) {
  store::RgbImage image{width, height, std::vector<std::uint8_t>()};
  image.values.assign(static_cast<std::size_t>(3 * width * height), code);
  return image;
}

TEST(ShotOfView, IsItsIdWithoutANumber) {
  EXPECT_EQ(shot_of_view("dolly_3"), "dolly");
  EXPECT_EQ(shot_of_view("path-of-light-0012"), "path-of-light");
  EXPECT_EQ(shot_of_view("j13i13"), "j13i13");  // no separator: a position, not a number
  EXPECT_EQ(shot_of_view("left"), "left");
  EXPECT_EQ(shot_of_view("0007"), "0007");
  EXPECT_EQ(shot_of_view("_7"), "_7");
  EXPECT_EQ(shot_of_view("left_"), "left_");
  EXPECT_EQ(shot_of_view(""), "");
}

TEST(ShotErrors, AnErrorThatStaysDoesNotFlicker) {
  ShotErrors errors;
  const std::vector<std::uint8_t> all(6, 1);
  for (const char* id : {"a_0", "a_1", "a_2"}) {
    errors.add(id, grey(3, 2, 110), grey(3, 2, 100), all);
  }
  const auto shots = errors.temporal_stability();
  ASSERT_EQ(shots.size(), 1U);
  EXPECT_EQ(shots[0].id, "a");
  EXPECT_EQ(shots[0].views, 3);
  EXPECT_EQ(shots[0].error_variance, 0);
  EXPECT_EQ(shots[0].mean_square_error, 100);
}

TEST(ShotErrors, IsTheVarianceOverTheViewsOfOneShot) {
  ShotErrors errors;
  const std::vector<std::uint8_t> all(6, 1);
  // The views of one shot alternate with those of another, which does not move.
  errors.add("a_0", grey(3, 2, 96), grey(3, 2, 100), all);
  errors.add("b_0", grey(3, 2, 50), grey(3, 2, 50), all);
  errors.add("a_1", grey(3, 2, 104), grey(3, 2, 100), all);
  errors.add("b_1", grey(3, 2, 60), grey(3, 2, 60), all);
  errors.add("alone", grey(3, 2, 0), grey(3, 2, 255), all);
  const auto shots = errors.temporal_stability();
  ASSERT_EQ(shots.size(), 2U);
  EXPECT_EQ(shots[0].error_variance, 16);
  EXPECT_EQ(shots[0].mean_square_error, 16);
  EXPECT_EQ(shots[1].error_variance, 0);
}

TEST(ShotErrors, AtEdgesIsOverTheViewsWithAnEdgeThere) {
  ShotErrors errors;
  const std::vector<std::uint8_t> all(3, 1);
  const std::vector<std::vector<std::uint8_t>> bands{{1, 1, 0}, {1, 0, 0}, {0, 1, 0}};
  for (std::size_t view = 0; view < bands.size(); ++view) {
    const auto code = static_cast<std::uint8_t>(100 + 10 * view);
    errors.add("a_" + std::to_string(view), grey(3, 1, code), grey(3, 1, 100), all, bands[view]);
  }
  // Errors 0 and 10 at the first pixel, 0 and 20 at the second one.
  EXPECT_EQ(errors.temporal_stability()[0].edge_band_error_variance, (25 + 100) / 2.0);
  ShotErrors unknown;
  for (const char* id : {"a_0", "a_1"}) unknown.add(id, grey(3, 1, 1), grey(3, 1, 2), all);
  EXPECT_TRUE(std::isnan(unknown.temporal_stability()[0].edge_band_error_variance));
}

TEST(ShotErrors, CountsWhatAllViewsCover) {
  ShotErrors errors;
  store::RgbImage wrong = grey(3, 2, 100);
  for (std::size_t c = 0; c < 3; ++c) wrong.values[c] = 255;  // in the first pixel
  std::vector<std::uint8_t> but_first(6, 1), all(6, 1), none(6, 0);
  but_first[0] = 0;
  errors.add("a_0", wrong, grey(3, 2, 100), but_first);
  errors.add("a_1", grey(3, 2, 100), grey(3, 2, 100), all);
  EXPECT_EQ(errors.temporal_stability()[0].mean_square_error, 0);
  errors.add("a_2", grey(4, 2, 0), grey(4, 2, 100), std::vector<std::uint8_t>(8, 1));
  EXPECT_EQ(errors.temporal_stability()[0].views, 2);
  errors.add("a_3", grey(3, 2, 100), grey(3, 2, 100), none);
  EXPECT_TRUE(std::isnan(errors.temporal_stability()[0].error_variance));
}

}  // namespace
}  // namespace raystage::evaluation
