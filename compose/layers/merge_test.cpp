// SPDX-License-Identifier: Apache-2.0
#include "compose/layers/merge.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <cmath>
#include <limits>
#include <random>

#include "testing/compose/test_layer_references.h"

namespace raystage::compose {
namespace {

constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// Returns one pixel of one colour.
LayerImage dot(float value, float alpha, float z) {
  LayerImage image = transparent_layer_image(1, 1);
  image.rgba = {value * alpha, value * alpha, value * alpha, alpha};
  image.z = {z};
  return image;
}

/// Returns an image with alphas of 0, 1 and between, and depths that are often equal or infinite.
LayerImage any_image(int width, int height, unsigned seed, bool with_normals) {
  std::mt19937 random(seed);
  std::uniform_real_distribution<float> share(0, 1);
  LayerImage image = transparent_layer_image(width, height);
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    const float any = share(random);
    const float alpha = any < 0.3F ? 0 : any < 0.6F ? 1 : share(random);
    for (std::size_t c = 0; c < 3; ++c) image.rgba[4 * i + c] = alpha * share(random);
    image.rgba[4 * i + 3] = alpha;
    image.z[i] = alpha == 0 ? kInfinity : std::floor(share(random) * 4);
  }
  image.ids.assign(image.pixels() * 2 * kIdRanks, 0.0F);
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    if (image.rgba[4 * i + 3] == 0) continue;
    const float share_of_first = 0.5F + 0.5F * share(random);
    float* ids = &image.ids[2 * kIdRanks * i];
    ids[0] = 1 + std::floor(share(random) * 3);
    ids[1] = share_of_first;
    if (share_of_first == 1) continue;
    ids[2] = ids[0] + 10;
    ids[3] = 1 - share_of_first;
  }
  image.aovs.push_back({"lf", {"coverage"}, false, 0, {}});
  for (std::size_t i = 0; i < image.pixels(); ++i) image.aovs[0].values.push_back(share(random));
  if (with_normals) {
    image.aovs.push_back({"N", {"X", "Y", "Z"}, false, 0, {}});
    for (std::size_t i = 0; i < 3 * image.pixels(); ++i) {
      image.aovs[1].values.push_back(share(random));
    }
  }
  return image;
}

TEST(Merge, PutsPremultipliedOverPremultiplied) {
  const LayerImage behind = dot(0.5F, 1, 9), front = dot(1, 0.25F, 2);
  const LayerImage both = merge({{{&behind}, {&front}}}, MergeOrder::kLayerOrder);
  EXPECT_FLOAT_EQ(both.rgba[0], 0.25F + 0.75F * 0.5F);
  EXPECT_FLOAT_EQ(both.rgba[3], 1);
  EXPECT_EQ(both.z[0], 9) << "three quarters of the pixel";
}

TEST(Merge, ByDepthTheNearerIsInFrontHoweverStated) {
  const LayerImage near = dot(1, 1, 2), far = dot(0.5F, 1, 3);
  EXPECT_EQ(merge({{{&near}, {&far}}}, MergeOrder::kLayerOrder).rgba[0], 0.5F);
  const LayerImage both = merge({{{&near}, {&far}}}, MergeOrder::kDepth);
  EXPECT_EQ(both.rgba[0], 1);
  EXPECT_EQ(both.z[0], 2);
  const LayerImage same = dot(0.25F, 1, 2);
  EXPECT_EQ(merge({{{&near}, {&same}}}, MergeOrder::kDepth).rgba[0], 0.25F) << "as stated";
}

TEST(Merge, AHoldoutCutsWhatIsBehindItAndShowsNothing) {
  const LayerImage behind = dot(0.5F, 1, 9), mask = dot(1, 0.75F, 2), front = dot(1, 0.5F, 1);
  const LayerImage all = merge({{{&behind}, {&mask, true}, {&front}}}, MergeOrder::kLayerOrder);
  EXPECT_FLOAT_EQ(all.rgba[3], 0.5F + 0.5F * 0.25F);
  EXPECT_FLOAT_EQ(all.rgba[0], 0.5F + 0.5F * 0.25F * 0.5F);
  EXPECT_EQ(all.z[0], 1);
  const LayerImage nothing =
      merge({{{&behind}, {&front, true}, {&front, true}}}, MergeOrder::kDepth);
  EXPECT_FLOAT_EQ(nothing.rgba[3], 0.25F);
}

TEST(Merge, NothingHasNoDepth) {
  const LayerImage none = dot(0, 0, 5);
  const LayerImage both = merge({{{&none}, {&none}}}, MergeOrder::kDepth);
  EXPECT_EQ(both.z[0], kInfinity);
  EXPECT_EQ(both.rgba[3], 0);
}

TEST(Merge, OneLayerIsItself) {
  const LayerImage image = any_image(13, 9, 4, true);
  const LayerImage merged = merge({{{&image}}}, MergeOrder::kDepth);
  EXPECT_EQ(merged.rgba, image.rgba);
  for (std::size_t i = 0; i < image.pixels(); ++i) {
    if (image.rgba[4 * i + 3] > 0) {
      EXPECT_EQ(merged.z[i], image.z[i]);
      EXPECT_EQ(merged.aovs[1].values[3 * i + 2], image.aovs[1].values[3 * i + 2]);
    } else {
      EXPECT_EQ(merged.aovs[0].values[i], 0);
    }
  }
}

TEST(Merge, AgreesWithTheReference) {
  EXPECT_TRUE(rc::check([] {
    const int count = *rc::gen::inRange(1, 6);
    const int width = *rc::gen::inRange(1, 20), height = *rc::gen::inRange(1, 20);
    const auto order = *rc::gen::element(MergeOrder::kLayerOrder, MergeOrder::kDepth);
    std::vector<LayerImage> images;
    for (int i = 0; i < count; ++i) {
      images.push_back(
          any_image(width, height, *rc::gen::arbitrary<unsigned>(), *rc::gen::arbitrary<bool>()));
    }
    std::vector<MergedLayer> layers;
    for (const LayerImage& image : images) {
      layers.push_back({&image, *rc::gen::inRange(0, 4) == 0});
    }
    const LayerImage fast = merge(layers, order), slow = testing::merge_reference(layers, order);
    RC_ASSERT(fast.aovs.size() == slow.aovs.size());
    std::size_t elsewhere = 0;
    for (std::size_t i = 0; i < fast.pixels(); ++i) {
      for (std::size_t c = 0; c < 4; ++c) {
        RC_ASSERT(std::abs(fast.rgba[4 * i + c] - slow.rgba[4 * i + c]) < 1e-6F);
      }
      elsewhere += fast.z[i] != slow.z[i];
      for (std::size_t rank = 0; rank < kIdRanks; ++rank) {
        const std::size_t at = 2 * (kIdRanks * i + rank);
        RC_ASSERT(std::abs(fast.ids[at + 1] - slow.ids[at + 1]) < 1e-5F);
        if (rank > 0 && fast.ids[at - 1] - fast.ids[at + 1] < 1e-5F) continue;  // alike: any order
        if (rank + 1 < kIdRanks && fast.ids[at + 1] - fast.ids[at + 3] < 1e-5F) continue;
        RC_ASSERT(fast.ids[at] == slow.ids[at]);
      }
    }
    RC_ASSERT(elsewhere == 0);
    for (std::size_t a = 0; a < fast.aovs.size(); ++a) {
      RC_ASSERT(fast.aovs[a].values == slow.aovs[a].values);
    }
  }));
}

}  // namespace
}  // namespace raystage::compose
