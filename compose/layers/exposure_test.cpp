// SPDX-License-Identifier: Apache-2.0
// Averages over an exposure must equal the trapezoidal rule written as one sum.
#include "compose/layers/exposure.h"

#include <gtest/gtest.h>

#include <cmath>
#include <limits>
#include <map>
#include <random>

namespace raystage::compose {
namespace {

constexpr int kPixels = 7;
constexpr float kNoDepth = std::numeric_limits<float>::infinity();

/// Returns an image with colours, coverage, albedo, a normal and three objects.
LayerImage random_image(std::mt19937& random) {
  std::uniform_real_distribution<float> unit(0, 1);
  LayerImage image = transparent_layer_image(kPixels, 1);
  image.aovs = {{"lf", {"coverage"}, false, 0, {}},
                {"albedo", {"R", "G", "B"}, true, 0, {}},
                {"N", {"X", "Y", "Z"}, false, 0, {}}};
  for (Aov& aov : image.aovs) aov.values.assign(kPixels * aov.channels.size(), 0.0F);
  image.ids.assign(std::size_t{kPixels} * 2 * kIdRanks, 0.0F);
  for (std::size_t pixel = 0; pixel < kPixels; ++pixel) {
    if (pixel == 0) continue;  // empty
    for (std::size_t c = 0; c < 4; ++c) image.rgba[4 * pixel + c] = unit(random);
    image.z[pixel] = 1 + unit(random);
    for (Aov& aov : image.aovs) {
      for (std::size_t c = 0; c < aov.channels.size(); ++c) {
        aov.values[aov.channels.size() * pixel + c] = unit(random);
      }
    }
    for (std::size_t rank = 0; rank < 3; ++rank) {
      image.ids[2 * (kIdRanks * pixel + rank)] = static_cast<float>(1 + random() % 4);
      image.ids[2 * (kIdRanks * pixel + rank) + 1] = 1.0F / 3;
    }
  }
  return image;
}

std::map<float, double> coverages(const LayerImage& image, std::size_t pixel, double weight,
                                  std::map<float, double> into = {}) {
  for (std::size_t rank = 0; rank < kIdRanks; ++rank) {
    const float* id = &image.ids[2 * (kIdRanks * pixel + rank)];
    if (id[1] > 0) into[id[0]] += weight * id[1] * image.rgba[4 * pixel + 3];
  }
  return into;
}

TEST(ExposureAverage, EqualsTheTrapezoidalRule) {
  std::mt19937 random(5);
  std::vector<LayerImage> images;
  for (int i = 0; i <= 8; ++i) images.push_back(random_image(random));
  for (const int intervals : {2, 4, 8}) {
    const int step = 8 / intervals;
    ExposureAverage average(images[4]);
    average.add_end(images[0]);
    average.add_end(images[8]);
    EXPECT_FALSE(average.end_level());
    for (int half = 2; half >= step; half /= 2) {
      for (int i = half; i < 8; i += 2 * half) average.add(images[i]);
      EXPECT_GT(average.end_level().value(), 0);
    }
    const LayerImage result = std::move(average).finish();
    const auto mean = [&](auto value_of) {
      double sum = (value_of(images[0]) + value_of(images[8])) / 2;
      for (int i = step; i < 8; i += step) sum += value_of(images[i]);
      return sum / intervals;
    };
    for (std::size_t i = 0; i < result.rgba.size(); ++i) {
      EXPECT_NEAR(result.rgba[i], mean([&](const LayerImage& of) { return of.rgba[i]; }), 1e-6);
    }
    for (const std::size_t aov : {0U, 1U}) {
      for (std::size_t i = 0; i < result.aovs[aov].values.size(); ++i) {
        EXPECT_NEAR(result.aovs[aov].values[i],
                    mean([&](const LayerImage& of) { return of.aovs[aov].values[i]; }), 1e-6);
      }
    }
    EXPECT_EQ(result.z, images[4].z);
    EXPECT_EQ(result.aovs[2].values, images[4].aovs[2].values);
    for (std::size_t pixel = 1; pixel < kPixels; ++pixel) {
      std::map<float, double> wanted;
      for (int i = 0; i <= 8; i += step) {
        wanted = coverages(images[i], pixel, (i % 8 == 0 ? 0.5 : 1.0) / intervals, wanted);
      }
      const std::map<float, double> found = coverages(result, pixel, 1);
      ASSERT_EQ(found.size(), wanted.size());
      for (const auto& [id, coverage] : wanted) EXPECT_NEAR(found.at(id), coverage, 1e-6);
      for (std::size_t rank = 1; rank < kIdRanks; ++rank) {
        EXPECT_LE(result.ids[2 * (kIdRanks * pixel + rank) + 1],
                  result.ids[2 * (kIdRanks * pixel + rank) - 1]);
      }
    }
  }
}

TEST(ExposureAverage, StatesHowMuchALevelChanges) {
  std::mt19937 random(6);
  const LayerImage image = random_image(random);
  ExposureAverage average(image);
  average.add_end(image);
  average.add_end(image);
  average.end_level();
  average.add(image);
  LayerImage other = image;
  other.rgba[9] += 0.4F;
  average.add(other);
  EXPECT_NEAR(average.end_level().value(), 0.1, 1e-6);
}

// What is only there before or after the middle has a depth and a normal.
TEST(ExposureAverage, FillsPixelsThatAreEmptyInTheMiddle) {
  std::mt19937 random(7);
  LayerImage empty = transparent_layer_image(kPixels, 1);
  const LayerImage shown = random_image(random);
  ExposureAverage average(empty);
  average.add_end(shown);
  average.add_end(empty);
  average.end_level();
  const LayerImage result = std::move(average).finish();
  EXPECT_EQ(result.z, shown.z);
  EXPECT_EQ(result.z[0], kNoDepth);
  ASSERT_EQ(result.aovs.size(), shown.aovs.size());
  EXPECT_EQ(result.aovs[2].values, shown.aovs[2].values);
  EXPECT_NEAR(result.rgba[7], shown.rgba[7] / 4, 1e-6);
  EXPECT_NEAR(result.aovs[1].values[4], shown.aovs[1].values[4] / 4, 1e-6);
  EXPECT_EQ(coverages(result, 1, 4).size(), coverages(shown, 1, 1).size());
}

// An opaque surface without depth, such as a plate, keeps its own.
TEST(ExposureAverage, KeepsTheDataOfOpaquePixels) {
  std::mt19937 random(8);
  LayerImage plate = transparent_layer_image(kPixels, 1);
  plate.rgba.assign(plate.rgba.size(), 1.0F);
  ExposureAverage average(plate);
  const LayerImage mesh = random_image(random);
  average.add_end(mesh);
  average.add_end(mesh);
  average.end_level();
  EXPECT_EQ(std::move(average).finish().z, plate.z);
}

// More objects than a pixel can name: those that cover most of it stay.
TEST(ExposureAverage, KeepsTheObjectsThatCoverMost) {
  LayerImage image = transparent_layer_image(1, 1);
  image.rgba[3] = 1;
  image.ids.assign(2 * kIdRanks, 0.0F);
  ExposureAverage average(image);
  for (int i = 0; i < 8; ++i) {
    image.ids[0] = static_cast<float>(i + 1);
    image.ids[1] = 0.5F;
    i < 2 ? average.add_end(image) : average.add(image);
  }
  // Two come late, with little in each image.
  for (int i = 0; i < 8; ++i) {
    image.ids[0] = static_cast<float>(7 + i % 2);
    image.ids[1] = 0.2F;
    average.add(image);
  }
  average.end_level();
  const LayerImage result = std::move(average).finish();
  EXPECT_EQ(std::max(result.ids[0], result.ids[2]), 8);
  EXPECT_EQ(std::min(result.ids[0], result.ids[2]), 7);
}

}  // namespace
}  // namespace raystage::compose
