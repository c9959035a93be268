// SPDX-License-Identifier: Apache-2.0
#include "render/common/push_pull.h"

#include <gtest/gtest.h>
#include <tbb/global_control.h>

#include <cmath>
#include <random>

namespace raystage::render {
namespace {

RenderedView empty(int width, int height) {
  return empty_view(virtual_camera_with_fov(width, height, 1, {}));
}

void set(RenderedView& view, std::size_t at, std::array<float, 3> colour, float alpha) {
  for (std::size_t c = 0; c < 3; ++c) view.rgba[at * 4 + c] = colour[c] * alpha;
  view.rgba[at * 4 + 3] = view.coverage[at] = alpha;
}

/// Returns a view of seen, half seen and unseen pixels. `holes`: the share of pixels that are not
/// fully seen.
RenderedView with_holes(int width, int height, double holes) {
  RenderedView view = empty(width, height);
  std::mt19937 random(static_cast<unsigned>(width * 1000 + height));
  std::uniform_real_distribution<float> any(0, 1);
  for (std::size_t i = 0; i < view.coverage.size(); ++i) {
    const float alpha = any(random) >= static_cast<float>(holes) ? 1.0F
                        : any(random) < 0.7F                     ? 0.0F
                                                                 : any(random);
    set(view, i, {any(random), any(random), any(random)}, alpha);
  }
  return view;
}

void expect_filled_as_by_the_reference(const RenderedView& holed) {
  RenderedView fast = holed, reference = holed;
  fill_push_pull(fast);
  fill_push_pull_reference(reference);
  double worst = 0;
  for (std::size_t i = 0; i < fast.rgba.size(); ++i) {
    ASSERT_TRUE(std::isfinite(fast.rgba[i])) << i;
    worst = std::max(worst, std::abs(static_cast<double>(fast.rgba[i] - reference.rgba[i])));
  }
  EXPECT_LT(worst, 1e-5);
  EXPECT_EQ(fast.coverage, holed.coverage);
  EXPECT_EQ(fast.z, holed.z);
}

TEST(PushPull, AgreesWithTheReferenceForEverySizeAndShareOfHoles) {
  for (const auto& [width, height] :
       {std::pair{1, 1}, {2, 1}, {1, 7}, {3, 3}, {5, 4}, {64, 64}, {131, 67}}) {
    for (const double holes : {0.02, 0.5, 0.999}) {
      SCOPED_TRACE(std::to_string(width) + "x" + std::to_string(height));
      expect_filled_as_by_the_reference(with_holes(width, height, holes));
    }
  }
}

TEST(PushPull, ChangesNothingThatWasSeenWhole) {
  const RenderedView whole = with_holes(37, 21, 0);
  RenderedView filled = whole;
  fill_push_pull(filled);
  EXPECT_EQ(filled.rgba, whole.rgba);

  const RenderedView holed = with_holes(37, 21, 0.4);
  filled = holed;
  fill_push_pull(filled);
  for (std::size_t i = 0; i < holed.coverage.size(); ++i) {
    EXPECT_EQ(filled.rgba[i * 4 + 3], 1);
    if (holed.coverage[i] < 1) continue;
    for (std::size_t c = 0; c < 4; ++c) EXPECT_EQ(filled.rgba[i * 4 + c], holed.rgba[i * 4 + c]);
  }
}

TEST(PushPull, LeavesWhatIsKnownToBeEmptyTransparent) {
  for (const auto& [width, height] : {std::pair{1, 1}, {37, 21}, {64, 64}}) {
    RenderedView view = with_holes(width, height, 0.5);
    std::mt19937 random(3);
    std::uniform_real_distribution<float> any(0, 1);
    for (const float alpha : view.coverage) {  // all, some or none of what was not seen
      const float part = any(random);
      view.empty_space.push_back((1 - alpha) * (part < 0.3F ? 1 : part < 0.6F ? 0.5F : 0));
    }
    SCOPED_TRACE(width);
    expect_filled_as_by_the_reference(view);
    RenderedView filled = view;
    fill_push_pull(filled);
    if (view.coverage.size() == 1 && view.coverage[0] == 0) continue;
    for (std::size_t i = 0; i < view.coverage.size(); ++i) {
      ASSERT_NEAR(filled.rgba[i * 4 + 3], 1 - view.empty_space[i], 1e-6) << i;
    }
  }
}

TEST(PushPull, LeavesAnEmptyViewEmpty) {
  for (const auto& [width, height] : {std::pair{1, 1}, {40, 30}}) {
    const RenderedView nothing = empty(width, height);
    RenderedView filled = nothing;
    fill_push_pull(filled);
    EXPECT_EQ(filled.rgba, nothing.rgba);
    fill_push_pull_reference(filled);
    EXPECT_EQ(filled.rgba, nothing.rgba);
  }
}

TEST(PushPull, OneColourFillsEverythingHoweverLittleOfItWasSeen) {
  for (const float alpha : {1.0F, 0.25F, 1e-6F}) {
    RenderedView view = empty(100, 50);
    set(view, 4321, {0.8F, 0.1F, 0.4F}, alpha);
    expect_filled_as_by_the_reference(view);
    fill_push_pull(view);
    for (std::size_t i = 0; i < view.coverage.size(); ++i) {
      ASSERT_NEAR(view.rgba[i * 4], 0.8, 1e-5);
      ASSERT_NEAR(view.rgba[i * 4 + 1], 0.1, 1e-5);
      ASSERT_EQ(view.rgba[i * 4 + 3], 1);
    }
  }
}

TEST(PushPull, FillsAHoleInARampSmoothly) {
  RenderedView view = empty(64, 64);
  for (int y = 0; y < 64; ++y) {
    for (int x = 0; x < 64; ++x) {
      const bool hole = x >= 24 && x < 40 && y >= 24 && y < 40;
      const float value = static_cast<float>(x) / 64;
      set(view, static_cast<std::size_t>(y * 64 + x), {value, value, value}, hole ? 0.0F : 1.0F);
    }
  }
  fill_push_pull(view);
  for (int x = 24; x < 40; ++x) {
    const float here = view.rgba[static_cast<std::size_t>(32 * 64 + x) * 4];
    EXPECT_NEAR(here, static_cast<float>(x) / 64, 0.12);
    EXPECT_NEAR(here, view.rgba[static_cast<std::size_t>(32 * 64 + x - 1) * 4], 0.06);  // no step
  }
}

TEST(PushPull, SameBytesForAnyNumberOfThreads) {
  const RenderedView holed = with_holes(300, 200, 0.6);
  std::vector<RenderedView> filled;
  for (const std::size_t threads : {1, 2, 5}) {
    const tbb::global_control limit(tbb::global_control::max_allowed_parallelism, threads);
    filled.push_back(holed);
    fill_push_pull(filled.back());
  }
  EXPECT_EQ(filled[0].rgba, filled[1].rgba);
  EXPECT_EQ(filled[0].rgba, filled[2].rgba);
}

}  // namespace
}  // namespace raystage::render
