// SPDX-License-Identifier: Apache-2.0
#include "store/processing/mattes/keyers.h"

#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>

#include "base/error.h"
#include "base/transfer_function.h"
#include "store/processing/mattes/box_mask.h"
#include "store/processing/mattes/clean_plate.h"
#include "store/processing/mattes/transfer_function.h"

namespace raystage::store {
namespace {

constexpr LinearColour kBlue{0.03F, 0.1F, 0.6F}, kGreen{0.08F, 0.55F, 0.1F};

schemas::MatteSettings exact(schemas::MatteSettings::Kind kind) {
  schemas::MatteSettings settings;
  settings.kind = kind;
  settings.black = 0;
  settings.white = 1;
  return settings;
}

LinearColour mixed(const LinearColour& front, const LinearColour& behind, float alpha) {
  LinearColour result;
  for (std::size_t c = 0; c < 3; ++c) result[c] = alpha * front[c] + (1 - alpha) * behind[c];
  return result;
}

TEST(ScreenKeys, TakeGreysOffTheScreenExactly) {
  for (const auto kind :
       {schemas::MatteSettings::Kind::kBlueScreen, schemas::MatteSettings::Kind::kGreenScreen}) {
    const LinearColour& screen = kind == schemas::MatteSettings::Kind::kBlueScreen ? kBlue : kGreen;
    schemas::MatteSettings settings = exact(kind);
    for (const double balance : {0.0, 0.5, 1.0}) {
      settings.balance = balance;
      const ColorDifferenceKeyer key(settings);
      for (const float alpha : {0.0F, 0.1F, 0.5F, 0.9F, 1.0F}) {
        const LinearColour grey{0.4F, 0.4F, 0.4F};
        const KeyedPixel keyed = key(mixed(grey, screen, alpha), screen);
        EXPECT_NEAR(keyed.alpha, alpha, 1e-5F);
        for (const float light : keyed.colour) EXPECT_NEAR(light, alpha * 0.4F, 1e-5F);
      }
    }
  }
}

TEST(ScreenKeys, NeverGiveLightOrAlphaThatIsNotThere) {
  const ColorDifferenceKeyer key(schemas::MatteSettings{});
  for (float r = 0; r <= 1; r += 0.1F) {
    for (float g = 0; g <= 1; g += 0.1F) {
      for (float b = 0; b <= 1.5F; b += 0.1F) {
        const KeyedPixel keyed = key({r, g, b}, kBlue);
        EXPECT_GE(keyed.alpha, 0);
        EXPECT_LE(keyed.alpha, 1);
        EXPECT_GE(*std::ranges::min_element(keyed.colour), 0);
        EXPECT_LE(keyed.colour[0], r);
        EXPECT_LE(keyed.colour[2], b);
        EXPECT_LE(key.excess(keyed.colour), 1e-6F) << "spill";
      }
    }
  }
}

TEST(ScreenKeys, LeaveSpillWhereNobodyWantsItOff) {
  schemas::MatteSettings settings;
  const LinearColour bluish{0.3F, 0.3F, 0.32F};  // lit by the screen
  EXPECT_NEAR(ColorDifferenceKeyer(settings)(bluish, kBlue).colour[2], 0.3F, 0.01F);
  settings.despill = 0;
  const KeyedPixel kept = ColorDifferenceKeyer(settings)(bluish, kBlue);
  EXPECT_EQ(kept.alpha, 1);
  EXPECT_NEAR(kept.colour[2], 0.3F, 0.02F);
}

TEST(ScreenKeys, CutOffWhatIsAlmostNothingOrAlmostAll) {
  const ColorDifferenceKeyer key(schemas::MatteSettings{});  // 0.05 and 0.95
  const LinearColour grey{0.5F, 0.5F, 0.5F};
  EXPECT_EQ(key(mixed(grey, kBlue, 0.04F), kBlue).alpha, 0);
  EXPECT_EQ(key(mixed(grey, kBlue, 0.96F), kBlue).alpha, 1);
  EXPECT_NEAR(key(mixed(grey, kBlue, 0.5F), kBlue).alpha, 0.5F, 1e-5F);
}

TEST(DifferenceKeys, GrowWithTheDistanceOfCodes) {
  schemas::MatteSettings settings;
  settings.low = 10;
  settings.high = 30;
  const DifferenceKeyer key(settings);
  const auto alpha = [&](float codes_apart) {
    const LinearColour codes{0.5F, 0.5F, 0.5F}, light{0.2F, 0.2F, 0.2F};
    LinearColour others = codes;
    for (float& code : others) code += codes_apart / 255;
    return key(light, codes, light, others).alpha;
  };
  EXPECT_EQ(alpha(9), 0);
  EXPECT_NEAR(alpha(20), 0.5F, 1e-4F);
  EXPECT_NEAR(alpha(-20), 0.5F, 1e-4F);
  EXPECT_EQ(alpha(31), 1);
}

TEST(CodeCurves, GoThereAndBack) {
  for (const BlendSpace space : {BlendSpace::kPerceptual, BlendSpace::kLinear}) {
    const TransferFunction curve({space, 1.3});
    for (int code = 0; code <= 65535; code += 5) {
      const auto exact_code = static_cast<std::uint16_t>(code);
      ASSERT_NEAR(curve.code(curve.linear(exact_code)), code, 0.4) << code;
    }
  }
  const TransferFunction curve({BlendSpace::kLinear, 1});
  for (double light = 0; light <= 1; light += 1e-3) {
    EXPECT_NEAR(curve.srgb(static_cast<float>(light)), srgb_from_linear(light), 2e-6);
  }
}

TEST(EmptySets, FindAnUnevenScreenAroundAnActor) {
  constexpr int kWidth = 160, kHeight = 120;
  Image<float, 3> rgb(kWidth, kHeight);
  const auto light_at = [](int x, int y, std::size_t c) {
    const double u = (2 * x + 1.0) / kWidth - 1, v = (2 * y + 1.0) / kHeight - 1;
    return static_cast<float>(static_cast<double>(kBlue[c]) *
                              (1 - 0.3 * u * u - 0.2 * v * v + 0.1 * u));
  };
  for (int y = 0; y < kHeight; ++y) {
    for (int x = 0; x < kWidth; ++x) {
      const bool actor = std::hypot(x - 80, y - 70) < 40;
      for (std::size_t c = 0; c < 3; ++c) rgb.pixel(x, y)[c] = actor ? 0.4F : light_at(x, y, c);
    }
  }
  const ColorDifferenceKeyer key(schemas::MatteSettings{});
  const CleanPlate set = CleanPlate::fitted(rgb, key, "test");
  for (int y = 0; y < kHeight; y += 7) {
    for (int x = 0; x < kWidth; x += 7) {
      for (std::size_t c = 0; c < 3; ++c) {
        ASSERT_NEAR(set.at(x, y)[c], light_at(x, y, c), 2e-3F) << x << ' ' << y;
      }
    }
  }
  const Image<float, 3> grey(kWidth, kHeight, 0.3F);
  EXPECT_THROW(CleanPlate::fitted(grey, key, "test"), Error);
}

TEST(SeenBoxes, KeepAndThrowAwayWhatRaysPass) {
  const rig::Rig::Camera camera{
      "c", rig::CameraModel({"c", 100, 80, {50, 50, 50, 40, {}}, {}, {}, {}}), {}, {}, {}, {}};
  const std::vector<schemas::MatteSettings::Box> front{{{{-1, -1, -3}, {1, 1, -2}}}};
  const std::vector<schemas::MatteSettings::Box> behind{{{{-1, -1, 2}, {1, 1, 3}}}};
  const std::vector<schemas::MatteSettings::Box> left{{{{-1, -9, -3}, {0, 9, -2}}}};
  const auto shown = [&](const std::vector<bool>& shows, int x, int y) {
    return static_cast<bool>(shows[y * 100 + x]);
  };
  const auto kept = compute_box_mask(camera, front, {});
  EXPECT_TRUE(shown(kept, 50, 40));
  EXPECT_TRUE(shown(kept, 26, 40));  // x = -1 at z = -2 is pixel 25
  EXPECT_FALSE(shown(kept, 24, 40));
  EXPECT_FALSE(shown(compute_box_mask(camera, behind, {}), 50, 40));
  const auto both = compute_box_mask(camera, front, left);
  EXPECT_FALSE(shown(both, 45, 40));
  EXPECT_TRUE(shown(both, 55, 40));
  const auto all = compute_box_mask(camera, {}, {});
  EXPECT_TRUE(std::ranges::all_of(all, [](bool shows) { return shows; }));
}

}  // namespace
}  // namespace raystage::store
