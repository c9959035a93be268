// SPDX-License-Identifier: Apache-2.0
// Every method there is, over every extreme there is: whoever adds one of either need not come
// here.
#include <gtest/gtest.h>

#include <algorithm>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "render/hull/test_matte.h"
#include "render/methods.h"
#include "render/renderer.h"
#include "render/view/extremes.h"
#include "schemas/error.h"

namespace raystage {
namespace {

using testing::Extreme;
using testing::extremes;
using testing::SyntheticTake;

/// The painted plane, in a range of depths of a thousandth of its own; the same in one from half to
/// ten times its depth; all white.
enum class Scene { kFlat, kDeep, kWhite };

class MethodExtremes : public ::testing::TestWithParam<std::string> {
 protected:
  /// The array's take, with mattes that hold all of its pictures.
  const Take& take_of(const std::string& array, Scene scene) {
    const std::string name = array + " " + std::to_string(static_cast<int>(scene));
    if (!takes_.contains(name)) {
      SyntheticTake take = testing::extreme_array(array);
      if (scene == Scene::kWhite) {
        take.painting = [](const auto&, const auto&) { return std::array<double, 3>{1, 1, 1}; };
      } else if (scene == Scene::kDeep) {
        take.depth_range = DepthRange{take.plane_depth / 2, take.plane_depth * 10};
      }
      write_synthetic_take(take, folder_.path() / name);
      for (const CameraGeometry& camera : take.cameras) {
        const std::vector<std::uint8_t> all(
            static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height), 255);
        testing::write_matte(folder_.path() / name, camera.id, 0, camera.width, camera.height, all);
      }
      takes_.emplace(name, folder_.path() / name);
    }
    return takes_.at(name);
  }

  /// Whether the method focuses on the plane that is given; others find out how deep the scene is.
  static bool looks_up_on_the_plane() {
    static const std::set<std::string> finders{"plane_sweep", "depth", "visual_hull", "auto"};
    return !finders.contains(GetParam());
  }

  /// The hull's reference takes 4096 even steps of inverse distance along each ray: minutes for
  /// what is asked here, and coarser than the methods may differ; visual_hull_test.cpp compares it.
  static bool has_quick_reference() { return GetParam() != "visual_hull"; }

  /// nullopt where the method refuses, as it may.
  std::optional<RenderedView> render(const Extreme& extreme, Scene scene, bool reference,
                                     BlendSpace space = BlendSpace::kPerceptual) {
    const Take& take = take_of(extreme.array, scene);
    RendererSettings settings;
    settings.reference = reference;
    settings.blend_space = space;
    settings.measure_coverage = method_named(GetParam()).measures_coverage;
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
    if (!image.cameras.empty()) {
      if (!(image.cameras[i] >= 0) || std::isinf(image.cameras[i])) return "cameras" + pixel;
      if (!(image.nearest_ray[i] >= 0)) return "the nearest ray" + pixel;
    }
    if (rgba[3] == 0 && std::isfinite(image.z[i])) return "a surface that nobody saw" + pixel;
    if (rgba[3] == 0 && (rgba[0] != 0 || rgba[1] != 0 || rgba[2] != 0)) {
      return "a colour that nobody saw" + pixel;
    }
  }
  return "";
}

/// How far a method's fast picture may be from its reference.
struct Tolerance {
  float colour = 4e-3F;
  double depth = 1e-3;   ///< relative
  double disparity = 0;  ///< or that much between neighbouring cameras, pixels
  /// Of the pixels that are seen: where a method cuts from camera to camera or from plane to plane,
  /// or a surface ends, a pixel may fall either way.
  double either_way = 0.002;
};

Tolerance tolerance_of(const std::string& method) {
  // Nodes of a slab that are no camera are sampled twice, those of the reference once.
  if (method == "slabs") return {1e-2F};
  // Costs are rounded to 8 bits, either way: depths between planes move by what they cannot tell.
  if (method == "plane_sweep") return {4e-3F, 1e-3, 0.05, 0.02};
  // The flat takes' depths range over a thousandth of themselves: either end is as good.
  if (method == "depth") return {4e-3F, 2e-3};
  return {};
}

struct Difference {
  std::size_t seen = 0;    ///< pixels that either sees
  std::size_t differ = 0;  ///< of them
};

/// `pixel_metres`: disparity between neighbouring cameras (pixels) per inverse depth.
Difference difference(const RenderedView& fast, const RenderedView& reference,
                      const Tolerance& tolerance, double pixel_metres) {
  Difference found;
  for (std::size_t i = 0; i < fast.coverage.size(); ++i) {
    bool same = true;
    for (std::size_t c = 4 * i; c < 4 * i + 4; ++c) {
      same = same && std::abs(fast.rgba[c] - reference.rgba[c]) < tolerance.colour;
    }
    const double a = double{fast.z[i]}, b = double{reference.z[i]};
    if (std::isfinite(a) && std::isfinite(b)) {
      same = same && (std::abs(a - b) < tolerance.depth * b ||
                      pixel_metres * std::abs(1 / a - 1 / b) < tolerance.disparity);
    }
    found.seen += fast.rgba[4 * i + 3] > 0 || reference.rgba[4 * i + 3] > 0 ? 1 : 0;
    found.differ += same ? 0 : 1;
  }
  return found;
}

/// That images are sound and alike must not be because they are empty.
TEST_P(MethodExtremes, ImagesAreSoundSeeWhatCanBeSeenAndTheFastOneIsTheReference) {
  const Tolerance tolerance = tolerance_of(GetParam());
  const std::vector<CameraGeometry> cameras = testing::extreme_array("grid").cameras;
  const double pixel_metres = cameras[0].intrinsics.fx *
                              (cameras[1].world_from_camera[3] - cameras[0].world_from_camera[3]);
  for (const Extreme& extreme : extremes()) {
    for (const Scene scene : {Scene::kFlat, Scene::kDeep}) {
      SCOPED_TRACE(extreme.name + (scene == Scene::kFlat ? ", flat" : ", deep"));
      const auto fast = render(extreme, scene, false);
      const auto reference = has_quick_reference() ? render(extreme, scene, true) : fast;
      ASSERT_TRUE(fast && reference);
      EXPECT_EQ(what_is_wrong(*fast), "");
      EXPECT_EQ(what_is_wrong(*reference), "") << "the reference";
      const Difference found = difference(*fast, *reference, tolerance, pixel_metres);
      EXPECT_LE(static_cast<double>(found.differ),
                tolerance.either_way * static_cast<double>(found.seen))
          << "of " << found.seen << " pixels";
      const bool blank = extreme.blank && looks_up_on_the_plane();
      EXPECT_EQ(found.seen > 0, !blank);
    }
  }
}

TEST_P(MethodExtremes, AWhiteWorldStaysWhite) {
  for (const Extreme& extreme : extremes()) {
    SCOPED_TRACE(extreme.name);
    for (const BlendSpace space : {BlendSpace::kPerceptual, BlendSpace::kLinear}) {
      for (const bool reference : {false, true}) {
        if (reference && !has_quick_reference()) continue;
        const auto image = render(extreme, Scene::kWhite, reference, space);
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
  for (const Method& method : methods()) names.emplace_back(method.name);
  return names;
}

INSTANTIATE_TEST_SUITE_P(Every, MethodExtremes, ::testing::ValuesIn(names()),
                         [](const auto& method) { return method.param; });

}  // namespace
}  // namespace raystage
