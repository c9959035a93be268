// SPDX-License-Identifier: Apache-2.0
// Tests every method with its presets over all extreme views and arrays
// (testing/render/extremes.h). New methods, presets and extremes are included automatically.
// Further settings in settings() use other code paths of a method.
#include <ImfChannelList.h>
#include <ImfFrameBuffer.h>
#include <ImfHeader.h>
#include <ImfOutputFile.h>
#include <gtest/gtest.h>

#include <algorithm>
#include <cctype>
#include <cmath>
#include <map>
#include <optional>
#include <set>
#include <string>

#include "base/atomic_file.h"
#include "base/error.h"
#include "render/methods.h"
#include "render/renderer.h"
#include "schemas/planes_document.h"
#include "testing/render/extremes.h"
#include "testing/render/test_matte.h"

namespace raystage::render {
namespace {

using testing::extremes;
using testing::ExtremeView;
using testing::SyntheticTake;

/// The painted plane with different depth ranges. kFlat: a thousandth of its depth; kOneDepth: its
/// depth alone (zmin = zmax); kDeep: half to ten times its depth. kWhite: all white.
enum class Scene { kFlat, kOneDepth, kDeep, kWhite };

/// A method, with options that use another code path of it.
struct Setting {
  std::string method;
  std::string options;  ///< "NAME=VALUE,..."

  bool has(std::string_view option) const { return options.find(option) != std::string::npos; }
};

void PrintTo(const Setting& setting, std::ostream* out) {
  *out << setting.method << ' ' << setting.options;
}

/// Writes the planar depths of a view's pixels: of the painted plane for a view straight ahead, and
/// 1.5 times as far on the right half.
void write_depth_map(const std::filesystem::path& file, const VirtualCamera& view) {
  std::vector<float> z;
  for (int y = 0; y < view.height; ++y) {
    for (int x = 0; x < view.width; ++x) {
      const double plane = view.pose.position.z() + 4;
      z.push_back(static_cast<float>(2 * x < view.width ? plane : 1.5 * plane));
    }
  }
  Imf::Header header(view.width, view.height);
  header.channels().insert("Z", Imf::Channel(Imf::FLOAT));
  Imf::OutputFile output(file.c_str(), header, 0);
  Imf::FrameBuffer buffer;
  buffer.insert("Z", Imf::Slice(Imf::FLOAT, reinterpret_cast<char*>(z.data()), sizeof(float),
                                sizeof(float) * static_cast<std::size_t>(view.width)));
  output.setFrameBuffer(buffer);
  output.writePixels(view.height);
}

class MethodExtremes : public ::testing::TestWithParam<Setting> {
 protected:
  /// Returns the array's take, with fully opaque mattes, a mesh of the painted plane, and a card
  /// that covers some of it.
  const store::Take& take_of(const std::string& array, Scene scene) {
    const std::string name = array + " " + std::to_string(static_cast<int>(scene));
    if (!takes_.contains(name)) {
      SyntheticTake take = testing::make_extreme_array(array);
      if (scene == Scene::kWhite) {
        take.scene = [](const auto&, const auto&) { return std::array<double, 3>{1, 1, 1}; };
      } else if (scene == Scene::kOneDepth) {
        take.depth_range = schemas::DepthRange{take.plane_depth, take.plane_depth};
      } else if (scene == Scene::kDeep) {
        take.depth_range = schemas::DepthRange{take.plane_depth / 2, take.plane_depth * 10};
      }
      if (GetParam().has("temporal")) take.frames = 2;
      write_synthetic_take(take, folder_.path() / name);
      write_file_atomically(folder_.path() / name / "wall.obj",
                            "v -9 -9 -4\nv 9 -9 -4\nv 9 9 -4\nv -9 9 -4\nf 1 2 3 4\n");
      write_file_atomically(
          folder_.path() / name / "card.json",
          schemas::format_planes(
              {{{"card", {{-0.4, -0.4, -2}, {0.3, -0.4, -2}, {0.3, 0.3, -2}, {-0.4, 0.3, -2}}}}}));
      for (const schemas::CameraGeometry& camera : take.cameras) {
        const std::vector<std::uint8_t> all(
            static_cast<std::size_t>(camera.width) * static_cast<std::size_t>(camera.height), 255);
        testing::write_matte(folder_.path() / name, camera.id, 0, camera.width, camera.height, all);
      }
      takes_.emplace(name, folder_.path() / name);
    }
    return takes_.at(name);
  }

  /// Returns all extreme views; for a method with options only those of few pixels near the world's
  /// origin.
  static std::vector<ExtremeView> rows() {
    std::vector<ExtremeView> rows = extremes();
    if (GetParam().options.empty()) return rows;
    std::erase_if(rows, [](const ExtremeView& extreme) {
      return extreme.array == "far off" || extreme.view.width > 100;
    });
    return rows;
  }

  /// Returns whether the method focuses on the given plane. Others estimate the depth of the scene,
  /// or have it from their options.
  static bool looks_up_on_the_plane() {
    static const std::set<std::string> finders{"plane_sweep", "depth", "visual_hull", "auto"};
    return !finders.contains(GetParam().method) && !GetParam().has("proxy=") &&
           !GetParam().has("objects=") && !GetParam().has("depth_map=") &&
           !GetParam().has("layout=box");  // each face has its own plane
  }

  /// Returns false for the hull, whose reference takes 4096 even steps of inverse distance along
  /// each ray. This would take minutes here and be coarser than the tolerance. visual_hull_test.cpp
  /// compares it.
  static bool has_quick_reference() { return GetParam().method != "visual_hull"; }

  /// Returns the view, or nullopt where the method rejects the request, as it may.
  std::optional<RenderedView> render(const ExtremeView& extreme, Scene scene, bool reference,
                                     store::BlendSpace space = store::BlendSpace::kPerceptual) {
    const store::Take& take = take_of(extreme.array, scene);
    RendererOptions settings;
    settings.reference = reference;
    settings.blend_space = space;
    settings.measure_coverage = method_named(GetParam().method).measures_coverage();
    if (GetParam().has("depth_map")) write_depth_map(take.folder() / "z.exr", extreme.view);
    try {
      return LightFieldRenderer(take, settings)
          .render(extreme.view, store::select_frames(take, 0, 1),
                  {GetParam().method, extreme.plane, options_from_text(GetParam().options)});
    } catch (const Error& error) {
      return std::nullopt;
    }
  }

 private:
  testing::TestFolder folder_;
  std::map<std::string, store::Take> takes_;
};

/// Returns the violated property of a rendered view, or an empty text.
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

/// The accepted difference of the fast view from the reference.
struct Tolerance {
  float colour = 4e-3F;
  double depth = 1e-3;   ///< relative
  double disparity = 0;  ///< or this much between neighbouring cameras, pixels
  /// Share of the seen pixels that may differ more: where a method changes cameras or planes, or a
  /// surface ends, rounding decides.
  double either_way = 0.002;
};

Tolerance tolerance_of(const std::string& method) {
  // Nodes without a camera are sampled twice, those of the reference once.
  if (method == "slabs") return {1e-2F};
  // Both implementations round costs to 8 bits, which moves depths between planes by what the costs
  // do not resolve.
  if (method == "plane_sweep") return {4e-3F, 1e-3, 0.05, 0.021};
  // In the flat take the range of depths is a thousandth of the depth: both of its ends are
  // accepted.
  if (method == "depth") return {4e-3F, 2e-3};
  return {};
}

struct Difference {
  std::size_t seen = 0;    ///< pixels with alpha in either view
  std::size_t differ = 0;  ///< of these, the pixels that differ
};

/// Returns the number of pixels that differ. `pixel_metres`: disparity between neighbouring cameras
/// (pixels) per inverse depth.
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

/// Images must be valid and equal, and not because they are empty.
TEST_P(MethodExtremes, ImagesAreSoundSeeWhatCanBeSeenAndTheFastOneIsTheReference) {
  const Tolerance tolerance = tolerance_of(GetParam().method);
  const std::vector<schemas::CameraGeometry> cameras = testing::make_extreme_array("grid").cameras;
  const double pixel_metres = cameras[0].intrinsics.fx *
                              (cameras[1].world_from_camera[3] - cameras[0].world_from_camera[3]);
  for (const ExtremeView& extreme : rows()) {
    for (const Scene scene : {Scene::kFlat, Scene::kOneDepth, Scene::kDeep}) {
      SCOPED_TRACE(extreme.name + (scene == Scene::kFlat       ? ", flat"
                                   : scene == Scene::kOneDepth ? ", one depth"
                                                               : ", deep"));
      if (scene == Scene::kOneDepth && looks_up_on_the_plane()) continue;  // range not used
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
      // The plane of a focus distance may be behind all cameras.
      if (!GetParam().has("focus_distance")) {
        EXPECT_EQ(found.seen > 0, !blank);
      }
    }
  }
}

TEST_P(MethodExtremes, AWhiteWorldStaysWhite) {
  for (const ExtremeView& extreme : rows()) {
    SCOPED_TRACE(extreme.name);
    for (const store::BlendSpace space :
         {store::BlendSpace::kPerceptual, store::BlendSpace::kLinear}) {
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

std::vector<Setting> settings() {
  // Settings that differ from the reference by more than the tolerance: weights every 16 pixels (up
  // to 3 of 432 pixels differ), half as many samples (nearly all do), planes four times as far
  // apart.
  static const std::set<std::string> rough{"weights=blending_field", "uv_scale=0.5",
                                           "step_px=2,aggregation=box,interpolation=linear"};
  std::vector<Setting> all;
  for (const Method* method : methods()) {
    all.push_back({std::string(method->name()), ""});
    for (const MethodPreset& preset : method->presets()) {
      const std::string options(preset.options);
      if (!rough.contains(options)) all.push_back({std::string(method->name()), options});
    }
  }
  all.push_back({"focal_plane", "objects=card.json"});
  all.push_back({"nearest", "objects=card.json"});
  for (const char* options : {"depth_map=z.exr", "f_number=0.25,focus_distance=3", "shape=square",
                              "shape=hexagon", "shape=octagon"}) {
    all.push_back({"aperture", options});
  }
  all.push_back({"lumigraph", "proxy=mesh,mesh=wall.obj"});
  for (const char* options :
       {"aggregation=box", "aggregation=none", "left_out=1", "edge_scale=8"}) {
    all.push_back({"plane_sweep", options});
  }
  all.push_back({"slabs", "layout=box"});
  all.push_back({"depth", "temporal=true"});
  return all;
}

std::string name_of(const ::testing::TestParamInfo<Setting>& info) {
  std::string name = info.param.method;
  if (!info.param.options.empty()) name += "_with_" + info.param.options;
  for (char& c : name) {
    if (std::isalnum(static_cast<unsigned char>(c)) == 0) c = '_';
  }
  return name;
}

INSTANTIATE_TEST_SUITE_P(Every, MethodExtremes, ::testing::ValuesIn(settings()), name_of);

}  // namespace
}  // namespace raystage::render
