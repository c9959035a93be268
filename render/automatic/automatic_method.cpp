// SPDX-License-Identifier: Apache-2.0
// The method "auto": lets choose() (automatic.cpp) select one of four candidates for a take,
// options and view size, caches the choice and renders the view by the chosen method. Adds the
// reason and, where it applies, extrapolation to the view's notes. Cost: that of the chosen method;
// choosing may render up to nine cameras per candidate once.
#include <fmt/format.h>

#include <array>
#include <filesystem>

#include "base/contained_path.h"
#include "base/error.h"
#include "base/large_buffer.h"
#include "render/automatic/automatic.h"
#include "render/automatic/extrapolation_note.h"
#include "render/common/scene_depth_range.h"
#include "render/depth/depth.h"
#include "render/planar/focal_plane.h"
#include "render/sweep/plane_sweep.h"

namespace raystage::render {
namespace {

constexpr std::array kOptions{
    number_option(
        "target_error", 0, 0, 100,
        "lowest accepted PSNR in dB (mean minus standard deviation at left-out cameras); 0: as "
        "accurate as possible"),
    number_option("near", 0, 0, 1e9,
                  "nearest object, metres in front of the array; 0: as in take.json"),
    number_option("far", 0, 0, 1e12,
                  "farthest object, metres in front of the array; 0: as in take.json"),
    number_option("target_time", 0, 0, 1e6,
                  "longest accepted time in seconds per frame, on two threads of the machine of "
                  "docs/benchmarks.md, from decoded frames with one sample per pixel; "
                  "0: no limit")};

/// Returns the candidates from the least to the most accurate (reasons: docs/decisions.md). Costs
/// are CPU ns per pixel on one thread with decoded frames: cpu_ns_per_px of methods_bench (960x640)
/// on the machine of docs/benchmarks.md, measured before the run of docs/performance.md:
///   disparity between neighbours   15 px (shop)  8 px (knights)  7 px (chess)  3 px (a test)
///   focal_plane                               8              10             9               8
///   plane_sweep with few planes             122             107           125              83
///   plane_sweep                             348             195           195             148
///   depth                                   391                           406             250
/// The values are straight lines through these. The later run has, for shop, 8, 133, 257 and 332:
/// only ratios decide, and the order of the candidates is the same. `depth` takes 38.4 s of CPU
/// time per light field frame for shop's 64 cameras of 960x640; chess takes less (660 ns).
std::vector<MethodCandidate> candidates() {
  return {
      {.label = "focal_plane", .method = &focal_plane_method(), .pixel_ns = 10},
      {.label = "plane_sweep with few planes",
       .method = &plane_sweep_method(),
       .options = {{"step_px", 2.0},
                   {"aggregation", std::string("box")},
                   {"interpolation", std::string("linear")}},
       .pixel_ns = 90,
       .disparity_ns = 2},
      {.label = "plane_sweep", .method = &plane_sweep_method(), .pixel_ns = 80, .disparity_ns = 17},
      {.label = "depth", .method = &depth_method(), .pixel_ns = 400, .instant_ns = 980}};
}

/// Returns the depth range in the options, if there is one.
std::optional<schemas::DepthRange> depth_range_option(const ViewRequest& request) {
  if (request.options.number("near") == 0 && request.options.number("far") == 0) return {};
  return scene_depth_range(request.options, *request.instant.take, "auto");
}

RenderedView render_with(const ViewRequest& request, bool reference) {
  const QualityTarget target{request.options.number("target_error"),
                             request.options.number("target_time"), depth_range_option(request)};
  std::vector<MethodCandidate> all = candidates();
  for (MethodCandidate& candidate : all) {
    if (!target.scene || candidate.method->uses_focal_plane()) continue;
    for (const char* name : {"near", "far"}) candidate.options[name] = request.options.number(name);
  }
  if (request.measure_coverage) {
    std::erase_if(all, [](const MethodCandidate& c) { return !c.method->measures_coverage(); });
  }
  // Within a renderer the take and the cameras do not change.
  const std::string key =
      fmt::format("auto {} {} {} {} {}x{} of {}", target.psnr_db, target.seconds_per_frame,
                  request.options.number("near"), request.options.number("far"),
                  request.view.width / request.supersampling,
                  request.view.height / request.supersampling, all.size());
  const auto choice = request.result_cache.get<MethodChoice>(key, [&](std::size_t& bytes) {
    bytes = 0;  // never evicted: pixels must not depend on the memory budget
    auto chosen = std::make_shared<const MethodChoice>(choose(all, target, request));
    request.buffers.release();  // methods that were measured but not chosen may have left blocks
    return chosen;
  });
  const MethodCandidate& chosen = all[choice->candidate];
  const MethodOptions options(chosen.method->options(), chosen.options, "auto");
  const auto render = reference ? &Method::render_reference : &Method::render;
  RenderedView view = (chosen.method->*render)(
      {request.view, request.instant, choice->focal_plane.value_or(request.focal_plane), options,
       request.result_cache, request.working_bytes, request.buffers, request.count_needed_pixels,
       request.measure_coverage, request.use_take_folder, request.supersampling, request.first_row,
       request.full_height});
  std::string note = "auto: " + choice->why;
  if (target.seconds_per_frame > 0 && request.supersampling > 1) {
    note += fmt::format("; the time is for one sample per pixel, this view takes {}",
                        request.supersampling * request.supersampling);
  }
  view.notes.push_back(std::move(note));
  if (choice->meets_target_leave_one_out) {
    if (auto beyond = extrapolation_note(request.view, request.instant)) {
      view.notes.push_back("auto: " + *beyond);
    }
  }
  return view;
}

class AutomaticMethod final : public Method {
 public:
  std::string_view name() const override { return "auto"; }
  MethodDescription description() const override {
    return {
        .summary = "chooses the cheapest of focal_plane, plane_sweep and depth that meets a target",
        .artefacts = "",
        .use = "automatic choice"};
  }
  std::span<const OptionSpec> options() const override { return kOptions; }
  std::span<const MethodPreset> presets() const override {
    static constexpr MethodPreset kPresets[]{{"30 dB", "target_error=30"},
                                             {"50 ms", "target_time=0.05"}};
    return kPresets;
  }
  RenderedView render(const ViewRequest& request) const override {
    return render_with(request, false);
  }
  RenderedView render_reference(const ViewRequest& request) const override {
    return render_with(request, true);
  }
  /// Returns the timeline, because measurements use its ticks.
  std::vector<std::filesystem::path> input_files(
      const MethodOptions& options, const store::Take& take,
      const store::FrameSelection& /*frames*/) const override {
    const ContainedPath timeline = take.file("timeline.zst");
    if (options.number("target_error") == 0 || !exists(timeline)) return {};
    return {timeline.path()};
  }
  void check_ray_support(const MethodOptions&) const override {
    throw Error::bad_input("the method auto can only choose for views, not for single rays",
                           "method auto", "Set another method");
  }
  bool uses_focal_plane() const override { return false; }
  bool may_use_focal_plane() const override { return true; }
  bool tells_surfaces_apart() const override { return true; }
  bool chooses_by_measuring() const override { return true; }
  bool depends_on_shown_views(const MethodOptions&) const override { return true; }
};

}  // namespace

const Method& automatic_method() {
  static const AutomaticMethod method;
  return method;
}

}  // namespace raystage::render
