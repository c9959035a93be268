// SPDX-License-Identifier: Apache-2.0
#include "render/sweep/edge_guide.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include "base/transfer_function.h"

namespace raystage::render::plane_sweep {
namespace {

using ::testing::ElementsAre;

TEST(EdgeGuide, IsTheLuminanceAsACode) {
  RenderedView picture;
  picture.width = 3;
  picture.height = 2;
  const auto grey = static_cast<float>(linear_from_srgb(100.0 / 255) * 0.5);  // of full scale 0.5
  picture.rgba = {0,        0,        0,        1,                            // black
                  0.5F,     0.5F,     0.5F,     1,                            // full scale
                  2,        2,        2,        1,                            // above full scale
                  grey,     grey,     grey,     1,                            //
                  grey / 4, grey / 4, grey / 4, 0.25F,  // the same colour with less alpha
                  0,        0,        0,        0};     // transparent
  picture.coverage = {1, 1, 1, 1, 0.25F, 0};
  EXPECT_THAT(edge_guide(picture, {store::BlendSpace::kPerceptual, 0.5}),
              ElementsAre(0, 255, 255, 100, 100, 0));
}

TEST(EdgeGuide, WeighsChannelsAsTheEyeDoes) {
  RenderedView picture;
  picture.width = 3;
  picture.height = 1;
  picture.rgba = {1, 0, 0, 1, 0, 1, 0, 1, 0, 0, 1, 1};
  picture.coverage = {1, 1, 1};
  const auto code = [](double luminance) {
    return static_cast<std::uint8_t>(255 * srgb_from_linear(luminance) + 0.5);
  };
  EXPECT_THAT(edge_guide(picture, {}), ElementsAre(code(0.2126), code(0.7152), code(0.0722)));
}

}  // namespace
}  // namespace raystage::render::plane_sweep
