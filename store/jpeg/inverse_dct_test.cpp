// SPDX-License-Identifier: Apache-2.0
#include "store/jpeg/inverse_dct.h"

#include <gtest/gtest.h>

#include <cmath>
#include <cstring>
#include <numbers>
#include <random>

#include "testing/test_simd_targets.h"

namespace raystage::store {
namespace {

using Samples = std::array<std::uint8_t, 128>;  // of both blocks, one after the other

Samples transformed(BlockPair pair, void (*transform)(BlockPair&)) {
  Samples samples{};
  pair.target = {samples.data(), samples.data() + 64};
  pair.stride = {8, 8};
  transform(pair);
  for (const std::int16_t c : pair.coefficients) EXPECT_EQ(c, 0);  // cleared for the next blocks
  return samples;
}

BlockPair random_pair(std::mt19937& random, int limit, unsigned zeros_in_10) {
  BlockPair pair;
  for (std::int16_t& c : pair.coefficients)
    if (random() % 10 >= zeros_in_10)
      c = static_cast<std::int16_t>(
          static_cast<int>(random() % (2u * static_cast<unsigned>(limit))) - limit);
  return pair;
}

TEST(InverseDct, EqualsTheReferenceWhateverTheCoefficientsOnEveryInstructionSet) {
  testing::for_each_simd_target(inverse_dct_target, [] {
    std::mt19937 random(1);
    for (int i = 0; i < 20000; ++i) {
      const int limits[] = {2, 40, 1024, 8000, 32767};
      const BlockPair pair = random_pair(random, limits[i % 5], static_cast<unsigned>(i / 5 % 10));
      ASSERT_EQ(transformed(pair, inverse_dct), transformed(pair, inverse_dct_reference)) << i;
    }
  });
}

TEST(InverseDct, IsTheCosineTransformWithinRounding) {
  std::mt19937 random(2);
  const auto basis = [](std::size_t x, std::size_t u) {
    return (u == 0 ? std::sqrt(0.125) : 0.5) *
           std::cos((2.0 * static_cast<double>(x) + 1) * static_cast<double>(u) * std::numbers::pi /
                    16);
  };
  for (int i = 0; i < 50; ++i) {
    const BlockPair pair = random_pair(random, 60, 5);
    const Samples samples = transformed(pair, inverse_dct);
    for (std::size_t at = 0; at < 128; ++at) {
      const std::size_t b = at / 64, y = at % 64 / 8, x = at % 8;
      double sum = 128;
      for (std::size_t v = 0; v < 8; ++v)
        for (std::size_t u = 0; u < 8; ++u)
          sum += basis(y, v) * basis(x, u) * pair.coefficients[v * 16 + b * 8 + u];
      ASSERT_NEAR(samples[at], std::clamp(sum, 0.0, 255.0), 0.6);
    }
  }
}

TEST(InverseDct, KnowsBlocksOfOneValue) {
  for (int dc = -8192; dc < 8192; ++dc) {
    BlockPair pair;
    pair.coefficients[0] = pair.coefficients[8] = static_cast<std::int16_t>(dc);
    Samples expected;
    expected.fill(dc_only_sample(static_cast<std::int16_t>(dc)));
    ASSERT_EQ(transformed(pair, inverse_dct), expected) << dc;
  }
}

TEST(InverseDct, LeavesOutAMissingSecondBlock) {
  BlockPair pair;
  pair.coefficients[0] = 80;
  Samples samples{};
  pair.target = {samples.data(), nullptr};
  pair.stride = {8, 8};
  inverse_dct(pair);
  EXPECT_EQ(samples[63], 138);
  EXPECT_EQ(samples[64], 0);
}

TEST(InverseDct, ZigzagPositionsAreTheStandards) {
  const int first[] = {0, 1, 8, 16, 9, 2, 3, 10, 17, 24};  // T.81 figure A.6
  for (std::size_t k = 0; k < 10; ++k)
    EXPECT_EQ(kZigzagToPairIndex[k], first[k] / 8 * 16 + first[k] % 8);
  EXPECT_EQ(kZigzagToPairIndex[62], 7 * 16 + 6);
  for (std::size_t k = 63; k < 80; ++k) EXPECT_EQ(kZigzagToPairIndex[k], 7 * 16 + 7);
}

}  // namespace
}  // namespace raystage::store
