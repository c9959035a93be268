// SPDX-License-Identifier: Apache-2.0
#include "render/common/fragments.h"

#include <gmock/gmock.h>
#include <gtest/gtest.h>
#include <rapidcheck.h>

#include <cmath>
#include <random>

#include "base/error.h"
#include "render/common/fragment_encoding.h"

namespace raystage::render {
namespace {

std::size_t at(int x, int y, int width) {
  return 4 * (static_cast<std::size_t>(y) * static_cast<std::size_t>(width) +
              static_cast<std::size_t>(x));
}

/// Returns a view in which some discs and single pixels hold sums and all others are zero.
std::vector<float> some_sums(int width, int height, unsigned seed) {
  std::mt19937 random(seed);
  std::vector<float> sums(at(0, height, width));
  for (int disc = 0; disc < 3; ++disc) {
    const double cx = random() % static_cast<unsigned>(width),
                 cy = random() % static_cast<unsigned>(height);
    const double radius = random() % 24;
    for (int y = 0; y < height; ++y) {
      for (int x = 0; x < width; ++x) {
        if (std::hypot(x - cx, y - cy) > radius) continue;
        float* pixel = &sums[at(x, y, width)];
        pixel[3] = static_cast<float>(65535.0 * (x + 1) / (width + 1));
        for (int c = 0; c < 3; ++c) {
          pixel[c] =
              pixel[3] * static_cast<float>(0.5 + 0.4 * std::sin(0.11 * (x + 7 * c) + 0.07 * y));
        }
      }
    }
  }
  return sums;
}

TEST(Fragments, CoverWhatIsNotZeroOnceAndStayWithinTheView) {
  EXPECT_TRUE(rc::check([] {
    const int width = *rc::gen::inRange(1, 120), height = *rc::gen::inRange(1, 90);
    const std::vector<float> sums = some_sums(width, height, *rc::gen::arbitrary<unsigned>());
    std::vector<int> covered(sums.size() / 4);
    for (const FragmentArea& area : cover_nonzero_pixels(sums, width, height)) {
      RC_ASSERT(area.x >= 0 && area.y >= 0 && area.x + area.width <= width &&
                area.y + area.height <= height);
      for (int y = area.y; y < area.y + area.height; ++y) {
        for (int x = area.x; x < area.x + area.width; ++x) ++covered[at(x, y, width) / 4];
      }
    }
    for (std::size_t i = 0; i < covered.size(); ++i) {
      RC_ASSERT(covered[i] <= 1);
      if (sums[4 * i + 3] != 0) RC_ASSERT(covered[i] == 1);
    }
  }));
}

TEST(Fragments, AreFewRectanglesWithLittleWaste) {
  // A triangle, like the area of a camera in a view.
  constexpr int kSize = 256;
  std::vector<float> sums(at(0, kSize, kSize));
  for (int y = 0; y < kSize; ++y) {
    for (int x = 0; x <= y; ++x) sums[at(x, y, kSize) + 3] = 1;
  }
  std::size_t pixels = 0;
  const auto areas = cover_nonzero_pixels(sums, kSize, kSize);
  for (const FragmentArea& area : areas) pixels += area.pixels();
  EXPECT_LE(areas.size(), std::size_t{kSize / kFragmentRows});
  EXPECT_LE(static_cast<double>(pixels), 1.04 * kSize * (kSize + 1) / 2);
  // A full view is one rectangle, an empty one none.
  std::ranges::fill(sums, 1.0F);
  EXPECT_THAT(cover_nonzero_pixels(sums, kSize, kSize),
              ::testing::ElementsAre(FragmentArea{0, 0, kSize, kSize}));
  std::ranges::fill(sums, 0.0F);
  EXPECT_TRUE(cover_nonzero_pixels(sums, kSize, kSize).empty());
}

constexpr FragmentTag kTag{7, 2, 1};

TEST(FragmentMessages, AddWhatTheyHold) {
  EXPECT_TRUE(rc::check([] {
    const int width = *rc::gen::inRange(1, 120), height = *rc::gen::inRange(1, 90);
    const std::vector<float> sums = some_sums(width, height, *rc::gen::arbitrary<unsigned>());
    const std::vector<float> other = some_sums(width, height, *rc::gen::arbitrary<unsigned>());
    for (const auto encoding :
         {FragmentEncoding::kFloat, FragmentEncoding::kHalf, FragmentEncoding::kJpeg}) {
      FragmentCounts counts;
      const auto message = encode_fragments(kTag, sums, width, height, {encoding, 95}, counts);
      RC_ASSERT(counts.bytes == static_cast<std::int64_t>(message.size()));
      std::vector<float> added = other;
      add_fragments(message, kTag, width, height, added);
      double squares = 0;
      for (std::size_t i = 0; i < sums.size(); ++i) {
        const float exact = other[i] + sums[i];
        if (encoding == FragmentEncoding::kFloat) RC_ASSERT(added[i] == exact);
        if (encoding == FragmentEncoding::kHalf) {
          RC_ASSERT(std::abs(added[i] - exact) <= sums[i] / 2048 + 0.02F);
        }
        if (encoding == FragmentEncoding::kJpeg) {
          if (i % 4 == 3) RC_ASSERT(added[i] == other[i]);
          if (i % 4 != 3) squares += std::pow((added[i] - exact) / 257, 2);
        }
      }
      if (encoding == FragmentEncoding::kJpeg) {
        RC_ASSERT(squares / static_cast<double>(sums.size()) < 80);  // edges of discs are hard
      }
    }
  }));
}

TEST(FragmentMessages, ThatAreDamagedAreRefused) {
  constexpr int kWidth = 60, kHeight = 40;
  const std::vector<float> sums = some_sums(kWidth, kHeight, 4);
  std::vector<float> to(sums.size());
  for (const auto encoding :
       {FragmentEncoding::kFloat, FragmentEncoding::kHalf, FragmentEncoding::kJpeg}) {
    FragmentCounts counts;
    const auto message = encode_fragments(kTag, sums, kWidth, kHeight, {encoding, 90}, counts);
    ASSERT_GT(counts.fragments, 0);
    const auto add = [&](std::span<const std::byte> bytes) {
      add_fragments(bytes, kTag, kWidth, kHeight, to);
    };
    EXPECT_NO_THROW(add(message));
    for (std::size_t size = 0; size < message.size(); size += 1 + size / 7) {
      EXPECT_THROW(add(std::span(message).first(size)), Error) << size;
    }
    EXPECT_THROW(add_fragments(message, {8, 2, 1}, kWidth, kHeight, to), Error);
    EXPECT_THROW(add_fragments(message, kTag, kWidth + 1, kHeight, to), Error);
    std::mt19937 random(1);
    for (int i = 0; i < 300; ++i) {  // nothing is read or written out of bounds
      auto flipped = message;
      flipped[random() % flipped.size()] ^= static_cast<std::byte>(1U << random() % 8);
      try {
        add(flipped);
      } catch (const Error&) {
      }
    }
  }
}

}  // namespace
}  // namespace raystage::render
