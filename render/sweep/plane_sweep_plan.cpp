// SPDX-License-Identifier: Apache-2.0
// Plans a view of the method "plane_sweep": the range of inverse depths (1/m) of the scene in the
// view, the planes, and the blending field. Planes are evenly spaced by the disparity of the
// selected cameras (step_px). Also defines the method and its options. Cost: O(tiles x cameras log
// cameras).
#include <fmt/format.h>

#include <algorithm>
#include <array>

#include "base/error.h"
#include "base/options.h"
#include "render/common/scene_depth_range.h"
#include "render/sweep/cost_kernels.h"
#include "render/sweep/plane_sweep.h"

namespace raystage::render {
namespace plane_sweep {

bool PlaneSweepOptions::is_valid(std::string* reason) const {
  if (p2 < p1) {
    *reason = "plane_sweep: p2 is less than p1";
    return false;
  }
  if (edge_scale > 0 && aggregation != Aggregation::kSemiGlobal) {
    *reason = "plane_sweep: edge_scale applies to p2, which only aggregation semi_global uses";
    return false;
  }
  return true;
}

namespace {

constexpr std::array kOptions{
    integer_option("cameras", 4, 1, kMaxMatchedCameras,
                   "number of cameras matched and blended per ray"),
    integer_option("planes", 0, 0, 512,
                   "number of planes between near and far; 0: as step_px requires"),
    number_option("step_px", 0.5, 0.05, 16,
                  "spacing of the planes, pixels of disparity between neighbouring cameras"),
    kNearOption,
    kFarOption,
    choice_option("aggregation", "semi_global", "semi_global|box|none",
                  "aggregation of costs over neighbouring pixels"),
    integer_option("p1", 40, 0, 4000,
                   "semi_global: penalty for a change of one plane (costs are 0 to 255)"),
    integer_option("p2", 800, 0, 4000, "semi_global: penalty for a larger change, at least p1"),
    integer_option("box_radius", 2, 1, 7, "box: pixels to each side in the sum"),
    number_option("truncation", 40, 1, 255, "largest difference of 8-bit codes that counts"),
    renamed_option(
        "left_out",
        integer_option(
            "outlier_cameras", 0, 0, kMaxMatchedCameras - 2,
            "number of cameras that agree least at a point, excluded there from matching and "
            "blending against occlusion; at least two remain")),
    number_option(
        "edge_scale", 0, 0, 255,
        "semi_global: step in luma, 8-bit codes, at which p2 is halved; needs a first pass, "
        "which doubles the time; 0: p2 is the same everywhere"),
    renamed_option("sub_plane",
                   flag_option("subplane_refinement", true,
                               "refine depths between planes by a parabola through the costs")),
    renamed_option("look_up", choice_option("interpolation", "cubic", "cubic|linear",
                                            "interpolation of source frames"))};

constexpr int kMaxPlanes = 512;

PlaneSweepOptions settings_of(const MethodOptions& options) {
  PlaneSweepOptions s;
  s.cameras = options.integer("cameras");
  const std::string& aggregation = options.text("aggregation");
  s.aggregation = aggregation == "semi_global" ? Aggregation::kSemiGlobal
                  : aggregation == "box"       ? Aggregation::kBox
                                               : Aggregation::kNone;
  s.interpolation =
      options.text("interpolation") == "cubic" ? Interpolation::kCubic : Interpolation::kLinear;
  s.subplane_refinement = options.flag("subplane_refinement");
  s.p1 = options.integer("p1");
  s.p2 = options.integer("p2");
  s.box_radius = options.integer("box_radius");
  s.truncation = options.number("truncation");
  s.excluded_cameras = options.integer("outlier_cameras");
  s.edge_scale = options.number("edge_scale");
  require_valid(s, "method plane_sweep");
  return s;
}

/// Returns the note; its number is rounded, so that many frames of a shot share it.
std::string too_few_planes(double step_px, double needed) {
  return fmt::format(
      "plane_sweep: {:g} px between planes (step_px) require up to {:.0f} planes across the view; "
      "only {} are used: near objects may show ghosts",
      step_px, rounded_for_display(needed), kMaxPlanes);
}

}  // namespace

std::optional<PlaneSweepPlan> plan(const ViewRequest& request) {
  const PlaneSweepOptions settings = settings_of(request.options);
  const rig::Rig& rig = *request.instant.rig;
  const InverseDepthRange range = inverse_depth_range_in_view(
      request.view, rig, scene_depth_range(request.options, *request.instant.take, "plane_sweep"));
  if (range.empty()) return std::nullopt;
  PlaneSweepPlan result{
      settings,
      BlendingField(request.view, rig, request.instant.present_cameras(), range, settings.cameras),
      BlendingField::complete(request.view, request.instant, range, settings.cameras),
      {},
      {}};
  const int asked_for = request.options.integer("planes");
  const double step_px = request.options.number("step_px");
  const double needed = asked_for > 0
                            ? asked_for
                            : required_plane_count(range, request.view, rig, result.field, step_px);
  result.planes =
      evenly_spaced_planes(range, static_cast<int>(std::min<double>(needed, kMaxPlanes)));
  if (needed > kMaxPlanes) result.notes.push_back(too_few_planes(step_px, needed));
  return result;
}

matching::SemiGlobalOptions semi_global_options(const PlaneSweepOptions& settings,
                                                std::span<const std::uint8_t> guide) {
  matching::SemiGlobalOptions result;
  result.p1 = settings.p1;
  result.p2 = settings.p2;
  result.subplane_refinement = settings.subplane_refinement;
  result.guide = guide;
  if (!guide.empty()) result.guide_scale = settings.edge_scale;
  return result;
}

}  // namespace plane_sweep

namespace {

class PlaneSweepMethod final : public Method {
 public:
  std::string_view name() const override { return "plane_sweep"; }
  MethodDescription description() const override {
    return {
        .summary =
            "blends the nearest cameras at the depth where they agree best, found per view by a "
            "plane sweep",
        .artefacts = "wrong where there is no texture, and at edges with occlusion in some cameras",
        .use = "takes in motion, individual views"};
  }
  std::span<const OptionSpec> options() const override { return plane_sweep::kOptions; }
  std::span<const MethodPreset> presets() const override {
    static constexpr MethodPreset kPresets[]{
        {"fast", "step_px=2,aggregation=box,interpolation=linear"}, {"6 cameras", "cameras=6"}};
    return kPresets;
  }
  RenderedView render(const ViewRequest& request) const override {
    return plane_sweep::render(request);
  }
  RenderedView render_reference(const ViewRequest& request) const override {
    return plane_sweep::render_reference(request);
  }
  /// Returns kFetchFrames: fetching parts of a few cameras' frames costs a hundredth of sending a
  /// cost volume.
  DistributionMode distribution(const MethodOptions&) const override {
    return DistributionMode::kFetchFrames;
  }
  void check(const MethodOptions& options, const store::Take& take) const override {
    plane_sweep::settings_of(options);
    scene_depth_range(options, take, "plane_sweep");
  }
  /// Returns the method `depth`, whose surface with the same depth range answers rays.
  RayDelegate ray_delegate(const MethodOptions& options) const override {
    return {"depth", {{"near", options.number("near")}, {"far", options.number("far")}}};
  }
  bool uses_focal_plane() const override { return false; }
};

}  // namespace

const Method& plane_sweep_method() {
  static const PlaneSweepMethod method;
  return method;
}

}  // namespace raystage::render
