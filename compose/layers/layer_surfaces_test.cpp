// SPDX-License-Identifier: Apache-2.0
#include "compose/layers/layer_surfaces.h"

#include <gtest/gtest.h>

#include <array>
#include <limits>

#include "compose/layers/deep_image.h"
#include "compose/layers/merge.h"

namespace raystage::compose {
namespace {

constexpr float kFar = std::numeric_limits<float>::infinity();

/// Two pixels of a layer: a whole surface at 5 m, and an edge of a surface at 2 m that covers 30 %.
LayerImage edge_image() {
  LayerImage image = transparent_layer_image(2, 1);
  const render::EdgePixel edge{1, {0.3F, 0.15F, 0, 0.3F}, {0, 0.2F, 0.4F, 1}, 2, 5};
  image.rgba = {0, 0.2F, 0.4F, 1, 0.3F, 0.15F + 0.7F * 0.2F, 0.7F * 0.4F, 1};
  image.z = {5, 5};
  image.aovs.push_back({"lf", {"coverage"}, false, 0, {1, 0.9F}});
  image.edges.push_back(edge);
  return image;
}

/// A surface that fills both pixels.
LayerImage solid_image(float depth, const std::array<float, 4>& rgba) {
  LayerImage image = transparent_layer_image(2, 1);
  for (std::size_t i = 0; i < 8; ++i) image.rgba[i] = rgba[i % 4];
  image.z.assign(2, depth);
  return image;
}

LayerImage merged(const LayerSurfaces& surfaces, const LayerImage& other,
                  MergeOrder order = MergeOrder::kDepth) {
  std::vector<MergedLayer> layers{{&other, false}};
  if (surfaces.behind) layers.push_back({&*surfaces.behind, false});
  layers.push_back({&surfaces.image, false});
  return merge(layers, order);
}

void expect_pixel(const LayerImage& image, std::size_t pixel, const std::array<float, 4>& rgba) {
  for (std::size_t c = 0; c < 4; ++c) EXPECT_NEAR(image.rgba[4 * pixel + c], rgba[c], 1e-6) << c;
}

TEST(LayerSurfaces, WhatStandsBetweenThemIsSeenBetween) {
  LayerSurfaces surfaces = separate_surfaces(edge_image());
  ASSERT_TRUE(surfaces.behind);
  EXPECT_TRUE(surfaces.image.edges.empty());
  EXPECT_EQ(surfaces.image.z[1], 2);
  EXPECT_EQ(surfaces.behind->z[0], kFar);
  EXPECT_EQ(surfaces.behind->aovs[0].values[1], 0.9F);
  EXPECT_EQ(surfaces.behind->aovs[0].values[0], 0);
  cover_behind(surfaces);
  const LayerImage ball = solid_image(3, {1, 1, 1, 1});
  const LayerImage between = merged(surfaces, ball);
  expect_pixel(between, 0, {1, 1, 1, 1});
  expect_pixel(between, 1, {0.3F + 0.7F, 0.15F + 0.7F, 0.7F, 1});
  EXPECT_EQ(between.z[1], 3);
  const LayerImage before = merged(surfaces, solid_image(1, {0, 0, 0, 0.5F}));
  expect_pixel(before, 1, {0.15F, 0.5F * 0.29F, 0.5F * 0.28F, 1});
  // Behind both, nothing of it is seen: the layer is as it was.
  const LayerImage after = merged(surfaces, solid_image(9, {1, 1, 1, 1}));
  expect_pixel(after, 1, {0.3F, 0.29F, 0.28F, 1});
  EXPECT_EQ(after.aovs[0].values[1], 0.9F);
}

// A holdout hides as much as the whole layer.
TEST(LayerSurfaces, HoldOutAsTheLayer) {
  LayerSurfaces surfaces = separate_surfaces(edge_image());
  cover_behind(surfaces);
  const LayerImage ball = solid_image(3, {1, 1, 1, 1});
  const LayerImage seen = merge(
      std::array<MergedLayer, 3>{
          MergedLayer{&ball, false}, {&*surfaces.behind, true}, {&surfaces.image, true}},
      MergeOrder::kDepth);
  expect_pixel(seen, 0, {1, 1, 1, 1});
  expect_pixel(seen, 1, {0.7F, 0.7F, 0.7F, 0.7F});
}

// Opacity and clips take as much of the sum as of the layer.
TEST(LayerSurfaces, OpacityActsOnTheSum) {
  for (const float opacity : {1.0F, 0.5F, 0.1F, 0.0F}) {
    LayerSurfaces surfaces = separate_surfaces(edge_image());
    for (LayerImage* image : {&surfaces.image, &*surfaces.behind}) {
      for (float& value : image->rgba) value *= opacity;
    }
    cover_behind(surfaces);
    const LayerImage alone = merged(surfaces, transparent_layer_image(2, 1));
    expect_pixel(alone, 1, {opacity * 0.3F, opacity * 0.29F, opacity * 0.28F, opacity});
  }
  // With the front clipped away its part of the pixel is empty.
  LayerSurfaces surfaces = separate_surfaces(edge_image());
  for (std::size_t c = 0; c < 4; ++c) surfaces.image.rgba[4 + c] = 0;
  cover_behind(surfaces);
  expect_pixel(merged(surfaces, transparent_layer_image(2, 1)), 1, {0, 0.14F, 0.28F, 0.7F});
}

TEST(LayerSurfaces, DeepSamplesAreThoseOfBoth) {
  LayerSurfaces surfaces = separate_surfaces(edge_image());
  cover_behind(surfaces);
  const std::array<MergedLayer, 2> layers{MergedLayer{&*surfaces.behind, false},
                                          {&surfaces.image, false}};
  const DeepImage deep = make_deep_image(layers);
  ASSERT_EQ(deep.begin, (std::vector<std::uint32_t>{0, 1, 3}));
  EXPECT_EQ(deep.samples[1].z, 2);
  EXPECT_FLOAT_EQ(deep.samples[1].rgba[3], 0.3F);
  EXPECT_EQ(deep.samples[2].z, 5);
  EXPECT_FLOAT_EQ(deep.samples[2].rgba[3], 1);
}

TEST(LayerSurfaces, WithoutEdgesThereIsOneImage) {
  LayerImage image = edge_image();
  image.edges.clear();
  EXPECT_FALSE(separate_surfaces(std::move(image)).behind);
}

}  // namespace
}  // namespace raystage::compose
