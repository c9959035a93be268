// SPDX-License-Identifier: Apache-2.0
#include "render/depth/depth_file.h"

#include <gtest/gtest.h>
#include <zstd.h>

#include <algorithm>
#include <array>
#include <bit>
#include <cmath>
#include <limits>
#include <random>

#include "base/error.h"

namespace raystage::render {
namespace {

std::vector<VirtualCamera> cameras() {
  std::vector<VirtualCamera> made(3);
  for (std::size_t i = 0; i < made.size(); ++i) {
    made[i].width = 17 + static_cast<int>(i);
    made[i].height = 11;
  }
  return made;
}

std::vector<InverseDepthMap> some_maps() {
  std::vector<InverseDepthMap> maps;
  std::mt19937 random(3);
  std::uniform_real_distribution<float> depth(0, 0.7F);
  for (const VirtualCamera& camera : cameras()) {
    InverseDepthMap map(camera.width, camera.height);
    for (float& value : map.values) value = random() % 5 == 0 ? kUnknownDepth : depth(random);
    maps.push_back(map);
  }
  maps[1] = {};  // of an absent camera
  return maps;
}

std::vector<std::byte> encoded(std::span<const InverseDepthMap> maps, std::uint64_t fingerprint) {
  std::vector<std::byte> file;
  encode_depth_maps(maps, fingerprint, [&](std::span<const std::byte> block) {
    file.insert(file.end(), block.begin(), block.end());
  });
  return file;
}

TEST(DepthFile, KeepsQuantisedDepthsToTheBit) {
  std::vector<InverseDepthMap> maps = some_maps();
  const std::vector<InverseDepthMap> exact = maps;
  for (InverseDepthMap& map : maps) quantise_depths(map);
  for (std::size_t m = 0; m < maps.size(); ++m) {
    for (std::size_t i = 0; i < maps[m].values.size(); ++i) {
      EXPECT_NEAR(maps[m].values[i], exact[m].values[i], 0.7F / 65534);
      EXPECT_EQ(maps[m].values[i] < 0, exact[m].values[i] < 0);
    }
  }
  const auto file = encoded(maps, 42);
  const auto read = decode_depth_maps(file, 42, cameras(), "test");
  ASSERT_EQ(read.size(), maps.size());
  for (std::size_t m = 0; m < maps.size(); ++m) EXPECT_EQ(read[m].values, maps[m].values);
  // Quantisation is idempotent for any largest depth, powers of two included.
  for (const float greatest : {1.0F, 65534.0F / 131072, 0.3F, 1e-9F, 4e6F}) {
    InverseDepthMap map(3, 1);
    map.values = {greatest, greatest / 3, 0};
    quantise_depths(map);
    InverseDepthMap again = map;
    quantise_depths(again);
    EXPECT_EQ(again.values, map.values);
    EXPECT_NEAR(map.values[0], greatest, greatest / 60000);
  }
}

TEST(DepthFile, RefusesAnotherVersionAndWhatGoesOn) {
  const auto pack = [](const std::vector<std::byte>& payload) {
    std::vector<std::byte> file(ZSTD_compressBound(payload.size()));
    file.resize(ZSTD_compress(file.data(), file.size(), payload.data(), payload.size(), 1));
    return file;
  };
  const auto refusal = [](std::span<const std::byte> file) -> std::string {
    try {
      decode_depth_maps(file, 42, cameras(), "test");
    } catch (const Error& error) {
      return error.what();
    }
    return "";
  };
  const auto file = encoded(some_maps(), 42);
  std::vector<std::byte> payload(100'000);
  payload.resize(ZSTD_decompress(payload.data(), payload.size(), file.data(), file.size()));
  EXPECT_EQ(refusal(pack(payload)), "");
  auto other = payload;
  other[8] = std::byte{2};
  EXPECT_NE(refusal(pack(other)).find("version"), std::string::npos);
  other = payload;
  other.push_back({});
  EXPECT_NE(refusal(pack(other)).find("damaged"), std::string::npos);
  auto longer = file;
  longer.push_back({});
  EXPECT_NE(refusal(longer).find("damaged"), std::string::npos);
}

TEST(DepthFile, RefusesStepsThatNoProgramWrites) {
  const auto file = encoded(some_maps(), 42);
  std::vector<std::byte> payload(100'000);
  payload.resize(ZSTD_decompress(payload.data(), payload.size(), file.data(), file.size()));
  const auto is_refused = [&](float step) {
    constexpr std::size_t kStepAt = 24 + 8;
    const auto bits = std::bit_cast<std::array<std::byte, 4>>(step);
    std::ranges::copy(bits, payload.begin() + kStepAt);
    std::vector<std::byte> packed(ZSTD_compressBound(payload.size()));
    packed.resize(ZSTD_compress(packed.data(), packed.size(), payload.data(), payload.size(), 1));
    try {
      decode_depth_maps(packed, 42, cameras(), "test");
    } catch (const Error&) {
      return true;
    }
    return false;
  };
  for (const float step : {0x1p-20F, 1.0F, 0x1p112F}) EXPECT_FALSE(is_refused(step)) << step;
  // Not a power of two; infinite when multiplied by a code; valid.
  for (const float step :
       {0.75F, 3e38F, 0x1p113F, 0x1p127F, 0.0F, -0.5F, std::numeric_limits<float>::infinity(),
        std::numeric_limits<float>::quiet_NaN()}) {
    EXPECT_TRUE(is_refused(step)) << step;
  }
}

TEST(DepthFile, RefusesWhatIsDamagedOrOfOtherInput) {
  std::vector<InverseDepthMap> maps = some_maps();
  const auto file = encoded(maps, 42);
  EXPECT_THROW(decode_depth_maps(file, 43, cameras(), "test"), Error);
  auto others = cameras();
  others[2].height = 12;
  EXPECT_THROW(decode_depth_maps(file, 42, others, "test"), Error);
  others.pop_back();
  EXPECT_THROW(decode_depth_maps(file, 42, others, "test"), Error);
  EXPECT_THROW(decode_depth_maps({}, 42, cameras(), "test"), Error);
  for (std::size_t cut = 1; cut < file.size(); cut += 7) {
    EXPECT_THROW(decode_depth_maps(std::span(file).first(cut), 42, cameras(), "test"), Error);
  }
  for (std::size_t at = 0; at < file.size(); at += 5) {
    auto flipped = file;
    flipped[at] ^= std::byte{0x10};
    try {
      const auto read = decode_depth_maps(flipped, 42, cameras(), "test");
      ADD_FAILURE() << "byte " << at << " may change unnoticed";
    } catch (const Error&) {
    }
  }
}

}  // namespace
}  // namespace raystage::render
