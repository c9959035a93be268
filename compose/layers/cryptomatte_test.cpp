// SPDX-License-Identifier: Apache-2.0
#include "compose/layers/cryptomatte.h"

#include <gtest/gtest.h>

#include <bit>
#include <cmath>
#include <nlohmann/json.hpp>

namespace raystage::compose {
namespace {

TEST(Cryptomatte, HashesAsTheOthersDo) {
  // Common test vectors of MurmurHash3_x86_32 with seed 0.
  EXPECT_EQ(murmur3_32(""), 0U);
  EXPECT_EQ(murmur3_32("a"), 0x3c2569b2U);
  EXPECT_EQ(murmur3_32("abc"), 0xb3dd93faU);
  EXPECT_EQ(murmur3_32("test"), 0xba6bd213U);
  EXPECT_EQ(murmur3_32("Hello, world!"), 0xc0363e43U);
  EXPECT_EQ(murmur3_32("The quick brown fox jumps over the lazy dog"), 0x2e4ff723U);
}

TEST(Cryptomatte, IdsAreNumbersThatCompare) {
  for (int i = 0; i < 20000; ++i) {
    const float id = object_id("object" + std::to_string(i));
    ASSERT_TRUE(std::isnormal(id)) << i;
  }
}

TEST(Cryptomatte, TheManifestNamesTheIdsInTheFile) {
  const std::vector<std::string> names{"set", "ball/left \"one\"", "caf\xc3\xa9"};
  const auto manifest = nlohmann::json::parse(cryptomatte_manifest(names));
  ASSERT_EQ(manifest.size(), 3U);
  for (const std::string& name : names) {
    const auto bits =
        static_cast<std::uint32_t>(std::stoul(manifest.at(name).get<std::string>(), nullptr, 16));
    EXPECT_EQ(std::bit_cast<float>(bits), object_id(name)) << name;
  }
  EXPECT_EQ(cryptomatte_manifest(std::vector<std::string>{"\xff"}).find("\xff"), std::string::npos);
}

TEST(Cryptomatte, CoverageIsTheShareOfThePixel) {
  LayerImage image = transparent_layer_image(2, 1);
  image.rgba = {0, 0, 0, 0.5F, 0, 0, 0, 0};
  assign_object_id(image, 7);
  image.ids[1] = 0.75F;
  image.ids[2] = 9;
  image.ids[3] = 0.25F;
  const std::vector<Aov> aovs = cryptomatte_aovs(image);
  ASSERT_EQ(aovs.size(), 3U);
  EXPECT_EQ(aovs[0].layer, "CryptoObject00");
  EXPECT_EQ(aovs[2].layer, "CryptoObject02");
  EXPECT_FALSE(aovs[0].is_colour) << "half would change ids";
  EXPECT_EQ(aovs[0].values, (render::PixelValues{7, 0.375F, 9, 0.125F, 0, 0, 0, 0}));
  EXPECT_EQ(aovs[1].values, render::PixelValues(8, 0.0F));
}

}  // namespace
}  // namespace raystage::compose
