// SPDX-License-Identifier: Apache-2.0
#include "evaluation/bench_crops.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <cstdint>
#include <string>

#include "evaluation/evaluation.h"

namespace raystage::evaluation::bench_crops_test {
namespace {

using ::testing::IsEmpty;
using ::testing::SizeIs;

/// A black truth, and pictures whose red differs in a square of 24 pixels.
class Pictures {
 public:
  Pictures(int width, int height)
      : truth_(width, height), covered_(static_cast<std::size_t>(width) * height, 1) {}

  void add(BenchCrops& crops, std::size_t row, std::size_t view, std::size_t views, int x, int y,
           std::uint8_t red) {
    store::RgbImage image = truth_;
    for (int v = y; v < y + 24; ++v) {
      for (int u = x; u < x + 24; ++u) {
        image.values[3 * (static_cast<std::size_t>(v) * image.width + u)] = red;
      }
    }
    const std::string id = "view" + std::to_string(view);
    crops.add(row, {view, views, id, image, truth_, covered_});
  }

 private:
  store::RgbImage truth_;
  std::vector<std::uint8_t> covered_;
};

std::size_t bytes_of_crops(const std::vector<BenchCrops::ChosenCrop>& chosen) {
  std::size_t bytes = 0;
  for (const BenchCrops::ChosenCrop& one : chosen) {
    bytes += one.crop.truth.values.size();
    for (const auto& picture : one.crop.pictures) bytes += picture.image.values.size();
  }
  return bytes;
}

TEST(BenchCrops, ShowWhereRowsDiffer) {
  Pictures pictures(320, 240);
  BenchCrops crops(2, 1);
  pictures.add(crops, 0, 0, 2, 0, 0, 60);
  pictures.add(crops, 0, 1, 2, 0, 0, 60);
  pictures.add(crops, 1, 0, 2, 0, 0, 60);
  pictures.add(crops, 1, 1, 2, 204, 180, 90);  // elsewhere, and larger
  const auto chosen = crops.chosen();
  ASSERT_THAT(chosen, SizeIs(1));
  EXPECT_EQ(chosen[0].reason, CropReason::kDifference);
  const BenchCrops::Crop& crop = chosen[0].crop;
  EXPECT_EQ(crop.view, "view1");
  EXPECT_EQ(crop.window.x, 144);
  EXPECT_EQ(crop.window.y, 144);
  EXPECT_EQ(crop.truth, store::RgbImage(96, 96));
  ASSERT_THAT(crop.pictures, SizeIs(2));
  EXPECT_EQ(crop.pictures[0].image, crop.truth);
  EXPECT_EQ(crop.pictures[1].row, 1U);
  const std::size_t first_red = 3 * ((180 - 144) * 96 + (204 - 144));
  EXPECT_EQ(crop.pictures[1].image.values[first_red], 90);
  EXPECT_EQ(crop.pictures[1].image.values[first_red - 3], 0);
}

TEST(BenchCrops, LeaveOutFailedRows) {
  Pictures pictures(320, 240);
  BenchCrops crops(3, 12);
  pictures.add(crops, 0, 0, 2, 0, 0, 60);  // fails at the second view
  crops.remove(0);
  EXPECT_THAT(crops.chosen(), IsEmpty());
  for (const std::size_t row : {1U, 2U}) {
    pictures.add(crops, row, 0, 2, 0, 0, 60);
    pictures.add(crops, row, 1, 2, 200, 100, 60);
  }
  const auto chosen = crops.chosen();
  EXPECT_THAT(chosen, ::testing::Not(IsEmpty()));
  for (const BenchCrops::ChosenCrop& one : chosen) {
    ASSERT_THAT(one.crop.pictures, SizeIs(2));
    EXPECT_EQ(one.crop.pictures[0].row, 1U);
  }
}

TEST(BenchCrops, WindowsWhereTheFirstRowErrsAreKeptOfLargeViews) {
  Pictures pictures(1600, 1200);
  constexpr std::size_t kRows = 600;  // 4 windows fit
  BenchCrops crops(kRows, 12);
  pictures.add(crops, 0, 0, 1, 1100, 900, 60);
  pictures.add(crops, 1, 0, 1, 1100, 900, 10);
  const auto chosen = crops.chosen();
  ASSERT_THAT(chosen, SizeIs(1));
  EXPECT_THAT(chosen[0].crop.window.x, ::testing::AllOf(::testing::Ge(1004), ::testing::Le(1100)));
  EXPECT_THAT(chosen[0].crop.window.y, ::testing::AllOf(::testing::Ge(804), ::testing::Le(900)));
}

TEST(BenchCrops, StayWithinTheirBounds) {
  Pictures pictures(200, 100);
  BenchCrops none;
  pictures.add(none, 0, 0, 1, 0, 0, 60);
  EXPECT_THAT(none.chosen(), IsEmpty());
  BenchCrops too_many(100'000, 12);
  pictures.add(too_many, 0, 0, 1, 0, 0, 60);
  EXPECT_THAT(too_many.chosen(), IsEmpty()) << "not even one window of each row fits";

  constexpr std::size_t kRows = 60, kViews = 100;
  BenchCrops crops(kRows, 48);
  for (std::size_t row = 0; row < kRows; ++row) {
    for (std::size_t view = 0; view < kViews; ++view) {
      pictures.add(crops, row, view, kViews, static_cast<int>(view), 0,
                   static_cast<std::uint8_t>(view + row));
    }
  }
  EXPECT_LE(crops.bytes(), BenchCrops::kMaxBytes);
  EXPECT_GT(crops.bytes(), BenchCrops::kMaxBytes / 3);
  EXPECT_LE(bytes_of_crops(crops.chosen()), BenchCrops::kMaxPageBytes);
  EXPECT_THAT(crops.chosen(), SizeIs(::testing::Ge(3)));
}

}  // namespace
}  // namespace raystage::evaluation::bench_crops_test
