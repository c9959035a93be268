// SPDX-License-Identifier: Apache-2.0
#include "replay/picture.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <limits>

#include "compose/exr/exr_file.h"

namespace raystage::replay {
namespace {

using schemas::ViewerMessage;
using Channel = ViewerMessage::Look::Channel;

constexpr int kWidth = 40, kHeight = 30;
constexpr float kInfinity = std::numeric_limits<float>::infinity();

/// Returns an opaque image whose grey value and depth depend on the column.
template <class Grey, class Depth>
compose::LayerImage image_of(const Grey& grey, const Depth& depth) {
  compose::LayerImage image = compose::transparent_layer_image(kWidth, kHeight);
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const auto i = static_cast<std::size_t>(y * kWidth + x);
      for (std::size_t c = 0; c < 3; ++c) image.rgba[4 * i + c] = grey(x);
      image.rgba[4 * i + 3] = 1;
      image.z[i] = depth(x);
    }
  }
  return image;
}

compose::LayerImage ramp() {
  return image_of([](int x) { return static_cast<float>(x) / kWidth; }, [](int) { return 3.0F; });
}

store::RgbImage make(const compose::LayerImage& image, const ViewerMessage::Look& look) {
  return PictureMaker(look, {}).make(image);
}

TEST(Pictures, HaveTheCodesOfPreviews) {
  const compose::LayerImage image = ramp();
  compose::ExrImage same{kWidth, kHeight, {image.rgba.begin(), image.rgba.end()}};
  for (const char* view : {"", "ACES 1.0 SDR"}) {
    ViewerMessage::Look look;
    look.exposure = 0.5;
    look.view = view;
    compose::DisplayOptions options;
    options.exposure = 0.5;
    options.view = view;
    EXPECT_EQ(make(image, look).values, compose::display(same, options).values) << view;
  }
}

TEST(Pictures, OfDepthGoFromRedNearToBlueFarLinearInInverseDepth) {
  const compose::LayerImage image = image_of(
      [](int) { return 0.5F; },
      [](int x) { return x == 0 ? kInfinity : 1 / (0.1F + 0.02F * static_cast<float>(x)); });
  const compose::InverseDepthSpan span = compose::inverse_depth_span(image.z);
  EXPECT_NEAR(span.far, 0.12, 0.02);
  EXPECT_NEAR(span.near, 0.88, 0.02);
  ViewerMessage::Look look;
  look.channel = Channel::kDepth;
  const store::RgbImage shown = make(image, look);
  EXPECT_GT(shown.at(1, 5, 2), shown.at(1, 5, 0)) << "far is blue";
  EXPECT_GT(shown.at(kWidth - 1, 5, 0), shown.at(kWidth - 1, 5, 2)) << "near is red";
  EXPECT_EQ(shown.at(0, 5, 0), shown.at(0, 5, 2)) << "no depth is grey";
  EXPECT_EQ(compose::false_color(0)[2], 110);
  EXPECT_EQ(compose::false_color(1)[0], 215);
  EXPECT_EQ(compose::false_color(std::nan("")), compose::false_color(0));
}

TEST(Pictures, OfDepthAtTheExtremesAreFinite) {
  ViewerMessage::Look look;
  look.channel = Channel::kDepth;
  for (const float z : {0.0F, -1.0F, 1e-30F, 1e30F, kInfinity, std::nanf("")}) {
    const compose::LayerImage image =
        image_of([](int) { return 0.5F; }, [&](int x) { return x % 2 == 0 ? z : 2.0F; });
    EXPECT_EQ(make(image, look).values.size(), 3U * kWidth * kHeight) << z;
    const compose::InverseDepthSpan span = compose::inverse_depth_span(image.z);
    EXPECT_GT(span.near, span.far) << z;
  }
  EXPECT_EQ(compose::inverse_depth_span(compose::transparent_layer_image(4, 4).z).near, 1);
}

TEST(Pictures, OfAlphaAndCoverageAreGrey) {
  compose::LayerImage image = ramp();
  image.aovs.push_back({"lf", {"coverage"}, false, 0, {}});
  image.aovs[0].values.assign(image.pixels(), 0.5F);
  image.rgba[3] = 0.25F;
  ViewerMessage::Look look;
  look.channel = Channel::kAlpha;
  EXPECT_EQ(make(image, look).at(0, 0), 64);
  EXPECT_EQ(make(image, look).at(1, 0, 2), 255);
  look.channel = Channel::kCoverage;
  EXPECT_EQ(make(image, look).at(3, 3), 128);
  image.aovs.clear();
  EXPECT_EQ(make(image, look).at(3, 3), 0) << "a shot without light fields has none";
}

TEST(Pictures, PeakingMarksSharpEdgesOnly) {
  const auto marked = [](const compose::LayerImage& image) {
    store::RgbImage picture = make(image, {});
    const store::RgbImage before = picture;
    mark_sharp_edges(image, picture);
    int count = 0;
    for (int x = 0; x < kWidth; ++x) count += picture.at(x, 9, 1) != before.at(x, 9, 1) ? 1 : 0;
    return count;
  };
  const auto depth = [](int) { return 3.0F; };
  compose::LayerImage step = image_of([](int x) { return x < 20 ? 0.2F : 0.6F; }, depth);
  EXPECT_EQ(marked(step), 2) << "both sides of the edge";
  EXPECT_EQ(marked(image_of([](int x) { return 0.2F + 0.01F * static_cast<float>(x); }, depth)), 0);
  for (std::size_t i = 3; i < step.rgba.size(); i += 4) step.rgba[i] = 0.5F;
  EXPECT_EQ(marked(step), 0) << "the background has edges, too";
}

}  // namespace
}  // namespace raystage::replay
