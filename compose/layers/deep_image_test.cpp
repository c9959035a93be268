// SPDX-License-Identifier: Apache-2.0
#include "compose/layers/deep_image.h"

#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <limits>

#include "testing/compose/test_layer_references.h"

namespace raystage::compose {
namespace {

LayerImage one_pixel(float grey, float alpha, float z) {
  LayerImage image = transparent_layer_image(1, 1);
  image.rgba = {grey * alpha, 0.5F * grey * alpha, 0, alpha};
  image.z = {z};
  return image;
}

TEST(DeepSamples, FlattenToWhatMergingMakes) {
  const auto flattens = [] {
    std::vector<LayerImage> images;
    std::vector<bool> holdout;
    const int count = *rc::gen::inRange(1, 6);
    for (int i = 0; i < count; ++i) {
      const auto share = [] { return static_cast<float>(*rc::gen::inRange(0, 5)) / 4; };
      const float z = static_cast<float>(*rc::gen::inRange(1, 5));
      images.push_back(one_pixel(share(), share(), z));
      holdout.push_back(*rc::gen::inRange(0, 3) == 0);
    }
    std::vector<MergedLayer> layers;
    for (std::size_t i = 0; i < images.size(); ++i) layers.push_back({&images[i], holdout[i]});
    const LayerImage merged = merge(layers, MergeOrder::kDepth);
    const DeepImage deep = make_deep_image(layers);
    const std::vector<float> flat = testing::flatten(deep);
    for (std::size_t c = 0; c < 4; ++c) {
      RC_ASSERT(std::abs(flat[c] - merged.rgba[c]) < 1e-5F);
    }
    for (std::size_t i = 1; i < deep.samples.size(); ++i) {
      RC_ASSERT(deep.samples[i - 1].z <= deep.samples[i].z);
    }
    for (const DeepImage::Sample& sample : deep.samples) RC_ASSERT(sample.rgba[3] <= 1.0F);
  };
  EXPECT_TRUE(rc::check("any few layers and holdouts", flattens));
}

TEST(DeepSamples, NothingHasNoneAndTheBackgroundIsFarButFinite) {
  const LayerImage nothing = one_pixel(0, 0, std::numeric_limits<float>::infinity());
  const LayerImage sky = one_pixel(1, 1, std::numeric_limits<float>::infinity());
  const MergedLayer layers[] = {{&sky, false}, {&nothing, false}};
  const DeepImage deep = make_deep_image(layers);
  ASSERT_EQ(deep.samples.size(), 1U);
  EXPECT_EQ(deep.samples[0].z, kBackgroundDepth);
  EXPECT_EQ(deep.begin, (std::vector<std::uint32_t>{0, 1}));
}

}  // namespace
}  // namespace raystage::compose
