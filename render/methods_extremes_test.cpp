// SPDX-License-Identifier: Apache-2.0
// Every method there is, over every extreme there is: whoever adds one of either need not come
// here.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <string>

#include "render/methods.h"
#include "render/renderer.h"
#include "render/view/extremes.h"
#include "schemas/error.h"

namespace raystage {
namespace {

using testing::Extreme;
using testing::extremes;
using testing::SyntheticTake;

class MethodExtremes : public ::testing::TestWithParam<std::string> {
 protected:
  /// The array's take, with the painted plane or all white.
  const Take& take_of(const std::string& array, bool white) {
    const std::string name = array + (white ? " white" : "");
    if (!takes_.contains(name)) {
      SyntheticTake take = testing::extreme_array(array);
      if (white) {
        take.painting = [](const auto&, const auto&) { return std::array<double, 3>{1, 1, 1}; };
      }
      write_synthetic_take(take, folder_.path() / name);
      takes_.emplace(name, folder_.path() / name);
    }
    return takes_.at(name);
  }

  /// nullopt where the method refuses, as it may.
  std::optional<RenderedView> render(const Extreme& extreme, bool white, bool reference,
                                     BlendSpace space = BlendSpace::kPerceptual) {
    const Take& take = take_of(extreme.array, white);
    RendererSettings settings;
    settings.reference = reference;
    settings.blend_space = space;
    try {
      return LightFieldRenderer(take, settings)
          .render(extreme.view, select_frames(take, 0, 1), {GetParam(), extreme.plane});
    } catch (const Error& error) {
      return std::nullopt;
    }
  }

 private:
  TestFolder folder_;
  std::map<std::string, Take> takes_;
};

/// What every rendered view must be; empty where it is.
std::string what_is_wrong(const RenderedView& image) {
  for (std::size_t i = 0; i < image.coverage.size(); ++i) {
    const float* rgba = &image.rgba[i * 4];
    const std::string pixel = " at pixel " + std::to_string(i);
    for (int c = 0; c < 4; ++c) {
      if (!std::isfinite(rgba[c])) return "a colour is not finite" + pixel;
    }
    if (!(rgba[3] >= 0 && rgba[3] <= 1 + 1e-6F)) return "alpha is not in [0, 1]" + pixel;
    if (!(image.coverage[i] >= 0 && image.coverage[i] <= rgba[3] + 1e-6F)) {
      return "coverage is not in [0, alpha]" + pixel;
    }
    if (!(image.z[i] > 0)) return "z is not positive" + pixel;
    if (rgba[3] == 0 && std::isfinite(image.z[i])) return "a surface that nobody saw" + pixel;
    if (rgba[3] == 0 && (rgba[0] != 0 || rgba[1] != 0 || rgba[2] != 0)) {
      return "a colour that nobody saw" + pixel;
    }
  }
  return "";
}

double mean_alpha(const RenderedView& view) {
  double sum = 0;
  for (std::size_t i = 3; i < view.rgba.size(); i += 4) sum += static_cast<double>(view.rgba[i]);
  return sum / static_cast<double>(view.coverage.size());
}

TEST_P(MethodExtremes, ImagesAreSoundAndTheFastOneIsTheReference) {
  const std::string method = GetParam();
  const bool finds_depth = method == "plane_sweep" || method == "depth";
  // Nodes of a slab that are no camera are sampled twice, those of the reference once.
  const float tolerance = method == "slabs" ? 1e-2F : 4e-3F;
  // The takes' depths range over a thousandth of themselves: either end is as good.
  const float z_tolerance = finds_depth ? 2e-3F : 1e-3F;
  int rendered = 0;
  for (const Extreme& extreme : extremes()) {
    SCOPED_TRACE(extreme.name);
    const auto fast = render(extreme, false, false);
    const auto reference = render(extreme, false, true);
    ASSERT_EQ(fast.has_value(), reference.has_value()) << "only one of them refuses";
    if (!fast) continue;
    ++rendered;
    EXPECT_EQ(what_is_wrong(*fast), "");
    EXPECT_EQ(what_is_wrong(*reference), "") << "the reference";
    // Where a method cuts from camera to camera, or a surface ends, a pixel may fall either way.
    std::size_t differ = 0;
    for (std::size_t i = 0; i < fast->coverage.size(); ++i) {
      bool same = true;
      for (std::size_t c = 4 * i; c < 4 * i + 4; ++c) {
        same = same && std::abs(fast->rgba[c] - reference->rgba[c]) < tolerance;
      }
      const float fast_z = fast->z[i], z = reference->z[i];
      same =
          same && (std::isinf(fast_z) || std::isinf(z) || std::abs(fast_z - z) < z_tolerance * z);
      differ += same ? 0 : 1;
    }
    EXPECT_LE(differ, fast->coverage.size() / 50) << "of " << fast->coverage.size() << " pixels";
  }
  EXPECT_GT(rendered, 0) << "refuses everything";
}

TEST_P(MethodExtremes, AWhiteWorldStaysWhite) {
  for (const Extreme& extreme : extremes()) {
    SCOPED_TRACE(extreme.name);
    for (const BlendSpace space : {BlendSpace::kPerceptual, BlendSpace::kLinear}) {
      for (const bool reference : {false, true}) {
        const auto image = render(extreme, true, reference, space);
        if (!image) continue;
        ASSERT_EQ(what_is_wrong(*image), "");
        float worst = 0;
        for (std::size_t i = 0; i < image->rgba.size(); ++i) {
          worst = std::max(worst, std::abs(image->rgba[i] - image->rgba[i | 3]));
        }
        EXPECT_LE(worst, 1e-6F) << (reference ? "the reference" : "");
      }
    }
  }
}

std::vector<std::string> names() {
  std::vector<std::string> names;
  for (const Method& method : methods()) {
    // The hull asks for mattes, which these takes do not have.
    if (method.name != "visual_hull") names.emplace_back(method.name);
  }
  return names;
}

INSTANTIATE_TEST_SUITE_P(Every, MethodExtremes, ::testing::ValuesIn(names()),
                         [](const auto& method) { return method.param; });

/// What can be seen is seen: that images are sound must not be because they are empty.
class OnThePlane : public MethodExtremes {};

TEST_P(OnThePlane, WhatCanBeSeenIsSeen) {
  for (const Extreme& extreme : extremes()) {
    SCOPED_TRACE(extreme.name);
    for (const bool reference : {false, true}) {
      const auto image = render(extreme, false, reference);
      ASSERT_TRUE(image.has_value());
      if (extreme.blank) {
        EXPECT_EQ(mean_alpha(*image), 0);
      } else {
        EXPECT_GT(mean_alpha(*image), 0);
      }
    }
  }
}

INSTANTIATE_TEST_SUITE_P(Every, OnThePlane, ::testing::Values("focal_plane", "nearest"),
                         [](const auto& method) { return method.param; });

}  // namespace
}  // namespace raystage
