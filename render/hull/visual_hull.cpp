// SPDX-License-Identifier: Apache-2.0
// The method "visual_hull": reads the mattes of the cameras at an instant (cached) and intersects
// the view's rays with their hull (hull_surface.cpp). Colours are blended by lumigraph weights
// (thesis, Reconstruction; Matusik et al. 2000). Cost: that of hull_surface.cpp and lumigraph.cpp.
#include "render/hull/visual_hull.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <string>

#include "base/contained_path.h"
#include "base/error.h"
#include "base/parallel.h"
#include "render/hull/hull_surface.h"
#include "render/lumigraph/lumigraph.h"
#include "store/processing/mattes/matte_file.h"

namespace raystage::render {
namespace {

constexpr int kReferenceSteps = 4096;

std::shared_ptr<const Matte> kept_matte(const LightFieldFrame& instant, ResultCache& kept,
                                        int camera, double threshold) {
  const auto file = store::matte_file(*instant.take, camera, instant.frame_of_camera[camera]);
  const auto reader = kept.get<store::MatteReader>("reader of mattes", [](std::size_t& bytes) {
    bytes = sizeof(store::MatteReader);
    return std::make_shared<const store::MatteReader>();
  });
  const rig::CameraModel& model = instant.rig->cameras[camera].model;
  return kept.get<Matte>(
      fmt::format("matte {} {}", threshold, file.path().string()), [&](std::size_t& bytes) {
        auto matte = std::make_shared<const Matte>(read_matte(*reader, file, model, threshold));
        bytes = matte->bytes();
        return matte;
      });
}

Error no_mattes(std::string what, const store::Take& take) {
  return Error::bad_input(std::move(what), (take.folder() / "mattes").string(),
                          "Write TAKE/mattes/CAMERA/FRAME.png (see docs/formats/mattes.md)");
}

void check_mattes(const MethodOptions&, const store::Take& take) {
  if (!exists(take.file("mattes"))) {
    throw no_mattes("the take has no mattes", take);
  }
}

/// Returns the silhouettes of the cameras that have a frame and a matte of it.
std::vector<Silhouette> silhouettes_of(const LightFieldFrame& instant, ResultCache& kept,
                                       double threshold) {
  std::vector<Silhouette> silhouettes;
  const store::Take& take = *instant.take;
  for (const int camera : instant.included_cameras) {
    const int frame = instant.frame_of_camera[camera];
    if (frame < 0 || !exists(store::matte_file(take, camera, frame))) continue;
    silhouettes.push_back({camera, nullptr});
  }
  if (silhouettes.empty()) throw no_mattes("no camera has a matte at this instant", take);
  raystage::parallel_for(std::size_t{0}, silhouettes.size(), [&](std::size_t i) {
    silhouettes[i].matte = kept_matte(instant, kept, silhouettes[i].camera, threshold);
  });
  return silhouettes;
}

int min_views(const MethodOptions& options, const std::vector<Silhouette>& silhouettes) {
  const double share = options.number("min_view_share");
  return std::max(1, static_cast<int>(std::ceil(share * static_cast<double>(silhouettes.size()))));
}

std::vector<std::filesystem::path> mattes_of(const store::Take& take, std::span<const int> frames) {
  std::vector<std::filesystem::path> files;
  for (std::size_t camera = 0; camera < frames.size(); ++camera) {
    if (frames[camera] < 0) continue;
    const ContainedPath file = store::matte_file(take, static_cast<int>(camera), frames[camera]);
    if (exists(file)) files.push_back(file.path());
  }
  return files;
}

/// Adds a note if mattes are missing: the hull of few silhouettes is too large, which the picture
/// does not show.
void note_missing_mattes(const LightFieldFrame& instant, RenderedView& view) {
  const auto frames = std::ranges::count_if(instant.frame_of_camera, [](int f) { return f >= 0; });
  const auto mattes =
      static_cast<std::ptrdiff_t>(mattes_of(*instant.take, instant.frame_of_camera).size());
  if (mattes < frames) {
    view.notes.push_back(fmt::format(
        "visual_hull: {} of {} cameras have no matte at this instant: the hull may be too large",
        frames - mattes, frames));
  }
}

/// Returns the surface on which rays meet the hull. Throws Error (bad input) if no camera has a
/// matte at the instant, or a matte is invalid.
RaySurface hull_of(const MethodOptions& options, const LightFieldFrame& instant, ResultCache& kept,
                   bool reference) {
  const auto silhouettes = silhouettes_of(instant, kept, options.number("threshold"));
  const int views = min_views(options, silhouettes);
  const double nearest = options.number("nearest");
  if (!reference) return hull_surface(*instant.rig, silhouettes, views, nearest);
  return hull_surface_reference(*instant.rig, silhouettes, views, nearest, kReferenceSteps);
}

std::vector<OptionSpec> hull_options() {
  std::vector<OptionSpec> all = ray_weight_options();
  all.push_back(number_option("threshold", 0.5, 0, 1,
                              "smallest matte value of foreground, as a share of full scale"));
  all.push_back(renamed_option(
      "seen_by",
      number_option("min_view_share", 0.5, 0, 1,
                    "share of the cameras with mattes that must see a point of the hull")));
  all.push_back(
      number_option("nearest", 0.1, 1e-6, 1e6, "start of the search, metres from the eye"));
  return all;
}

class VisualHullMethod final : public Method {
 public:
  std::string_view name() const override { return "visual_hull"; }
  MethodDescription description() const override {
    return {.summary = "shows only the foreground within the mattes of all cameras",
            .artefacts = "hollows are filled",
            .use = "actors in front of a keyed background"};
  }
  std::span<const OptionSpec> options() const override { return options_; }

  RenderedView render(const ViewRequest& request) const override {
    RenderedView view = render_lumigraph(
        request, hull_of(request.options, request.instant, request.result_cache, false),
        ray_weight_options(request.options), WeightField::kPerPixel, MissedRay::kKnownEmpty);
    note_missing_mattes(request.instant, view);
    return view;
  }
  RenderedView render_reference(const ViewRequest& request) const override {
    RenderedView view = render_lumigraph_reference(
        request, hull_of(request.options, request.instant, request.result_cache, true),
        ray_weight_options(request.options), MissedRay::kKnownEmpty);
    note_missing_mattes(request.instant, view);
    return view;
  }

  void check(const MethodOptions& options, const store::Take& take) const override {
    check_mattes(options, take);
  }
  std::vector<std::filesystem::path> input_files(
      const MethodOptions&, const store::Take& take,
      const store::FrameSelection& frames) const override {
    return mattes_of(take, frames.frame);
  }

  RaySurface surface(const SurfaceRequest& r) const override {
    return hull_of(r.options, r.instant, r.result_cache, r.reference);
  }
  bool has_ray_weights() const override { return true; }
  bool uses_focal_plane() const override { return false; }
  bool marks_empty_space() const override { return true; }
  bool shows_foreground_only() const override { return true; }
  bool is_row_independent(const MethodOptions&) const override { return true; }

 private:
  std::vector<OptionSpec> options_ = hull_options();
};

}  // namespace

const Method& visual_hull_method() {
  static const VisualHullMethod method;
  return method;
}

}  // namespace raystage::render
