// SPDX-License-Identifier: Apache-2.0
// Plans a view of the method "depth". Reads or estimates the depths of all cameras (depth_store.h)
// and, if option `temporal` is set, averages them over adjacent frames. Then fuses the hypotheses
// of up to 8 cameras per tile corner to the view's depths (fusion.cpp). Output: DepthViewPlan with
// inverse depths in 1/m of all pixels of the pinhole view, and the blending field of the cameras.
// Cost: estimation once per instant; fusion O(pixels x hypotheses^2) per view. Also defines the
// method.
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <map>

#include "base/parallel.h"
#include "render/common/faceted_frame.h"
#include "render/common/memory_overrun_note.h"
#include "render/common/scene_depth_range.h"
#include "render/depth/depth.h"
#include "render/depth/depth_store.h"
#include "render/depth/depth_surface.h"
#include "render/depth/distributed.h"
#include "render/depth/estimation_kernels.h"
#include "render/depth/fusion.h"
#include "render/depth/imported_depths.h"
#include "render/depth/temporal_filter.h"
#include "render/depth/temporal_motion.h"
#include "render/depth/warp.h"

namespace raystage::render {
namespace depth {
namespace {

constexpr int kMaxCameras = 64;

constexpr std::array kOptions{
    integer_option("cameras", 16, 1, kMaxCameras, "number of cameras blended per ray"),
    kNearOption,
    kFarOption,
    number_option("plane_px", 0.5, 0.1, 16,
                  "spacing of the planes of the initial sweep, pixels of disparity between "
                  "neighbouring cameras"),
    integer_option("neighbours", 8, 1, kMaxNeighbours, "cameras with which each camera is matched"),
    renamed_option("witnesses", integer_option("support_views", 12, 1, kMaxSupportViews,
                                               "support views: cameras that refine a depth")),
    renamed_option("agreement",
                   number_option("color_tolerance", 10, 0.1, 255,
                                 "difference of 8-bit codes at which a camera's weight is halved")),
    flag_option("all_cameras", false,
                "estimate the depths of all cameras, not only those that the frames of a moving "
                "take need: for takes that several shots show"),
    flag_option("temporal", false,
                "average depths with those of the adjacent ticks of the timeline, where a "
                "camera's picture stands still or its motion can be followed"),
    flag_option("soft_edges", true,
                "pixels at edges of depth show two surfaces: the one in front covers a part of "
                "each"),
    renamed_option(
        "keep",
        flag_option("store_depths", true,
                    "store depths in the take's folder depth/, and use those stored there"))};

DepthViewOptions settings_of(const MethodOptions& options, const store::Take& take,
                             bool use_take_folder) {
  DepthViewOptions s;
  s.estimation.scene = scene_depth_range(options, take, "depth");
  s.estimation.plane_px = options.number("plane_px");
  s.estimation.neighbours = options.integer("neighbours");
  s.estimation.support_views = options.integer("support_views");
  s.cameras = options.integer("cameras");
  s.agreement = options.number("color_tolerance");
  s.stores_depths = options.flag("store_depths") && use_take_folder;
  s.all_cameras = options.flag("all_cameras");
  s.temporal = options.flag("temporal");
  s.soft_edges = options.flag("soft_edges");
  return s;
}

constexpr int kHypotheses = 8;  ///< cameras whose depths are fused at a tile's corner

/// Returns the pixels whose depths the views of a light field frame need. Averages over time also
/// read the depths of ticks that other views show: all are estimated.
EstimationRegions regions_of(const DepthViewOptions& settings, const LightFieldFrame& instant) {
  if (settings.temporal || settings.all_cameras) return {};
  return needed_regions(instant, settings.estimation.scene,
                        std::max(settings.cameras, kHypotheses));
}

/// Returns the same, computed once for all views of the light field frame.
EstimationRegions cached_regions(const DepthViewOptions& settings, const ViewRequest& request) {
  if (request.instant.shown_views.empty()) return {};
  std::string key = fmt::format("estimation regions {} {} {} {}", settings.estimation.scene.near,
                                settings.estimation.scene.far, settings.cameras,
                                settings.temporal || settings.all_cameras);
  for (const int frame : request.instant.frame_of_camera) key += fmt::format(" {}", frame);
  for (const VirtualCamera& view : request.instant.shown_views) {
    const schemas::Intrinsics& k = view.intrinsics;
    key += fmt::format("; {} {} {} {} {} {} {} {} {}", view.width, view.height, k.fx, k.fy, k.cx,
                       k.cy, k.distortion.k1, k.distortion.k2, k.distortion.k3);
    key += fmt::format(" {} {} {}", k.distortion.p1, k.distortion.p2, view.is_equirectangular);
    for (const double value : view.pose.position) key += fmt::format(" {}", value);
    for (const double value : view.pose.world_from_camera_rotation.reshaped()) {
      key += fmt::format(" {}", value);
    }
  }
  return *request.result_cache.get<EstimationRegions>(key, [&](std::size_t& bytes) {
    auto made = std::make_shared<const EstimationRegions>(regions_of(settings, request.instant));
    bytes = key.size() + sizeof(*made) + made->size() * sizeof(PixelRectangle);
    return made;
  });
}

/// Returns the cameras that have a frame and depths.
std::vector<int> cameras_with_depths(const LightFieldFrame& instant,
                                     const EstimationRegions& regions) {
  std::vector<int> cameras = instant.present_cameras();
  std::erase_if(cameras, [&](int camera) { return !has_region(regions, camera); });
  return cameras;
}

/// Returns the largest number of planes that a camera's initial sweep requires, before the limit.
double required_plane_count(const CameraDepths& depths, const LightFieldFrame& instant,
                            const DepthEstimationOptions& estimation) {
  double most = 1;
  for (std::size_t i = 0; i < depths.pinholes.size(); ++i) {
    const int camera = static_cast<int>(i);
    if (!instant.is_present(camera) || !has_region(estimation.regions, camera)) continue;
    most = std::max(most, initial_sweep_planes(depths, instant, camera, estimation).needed);
  }
  return most;
}

/// Returns cached, stored or newly estimated depths. Adds the cost of an estimation to `work`.
std::shared_ptr<const NotedDepths> camera_depths(
    const LightFieldFrame& instant, ResultCache& result_cache, std::size_t working_bytes,
    const DepthEstimationOptions& estimation, bool stores_depths, DepthEstimationStatistics& work) {
  return result_cache.get<NotedDepths>(
      depth_cache_key(instant, estimation), [&](std::size_t& bytes) {
        auto kept = std::make_shared<NotedDepths>();
        std::string note;
        const auto imported = ImportedDepths::of(*instant.take, result_cache);
        if (imported->covers(instant, estimation.regions)) {
          kept->depths = camera_depths_without_maps(instant, estimation);
        } else {
          kept->depths = load_or_estimate_camera_depths(instant, estimation, working_bytes,
                                                        stores_depths, note);
          kept->notes = depth_notes(kept->depths, instant, estimation);
        }
        if (imported->replace(instant, estimation, kept->depths)) {
          kept->notes.emplace_back(kImportedDepthsNote);
        }
        if (!note.empty()) kept->notes.push_back(note);
        kept->depths.compute_block_nearest();
        bytes = kept->depths.bytes();
        work.bytes = std::max(work.bytes, kept->depths.working_bytes);
        work.pixels_decoded += kept->depths.pixels_decoded;
        return kept;
      });
}

/// Returns the light field frames of LightFieldFrame::adjacent_frames, with included cameras only.
std::vector<LightFieldFrame> adjacent_instants(const LightFieldFrame& instant) {
  std::vector<LightFieldFrame> instants;
  for (const std::vector<int>& frames : instant.adjacent_frames) {
    LightFieldFrame other = instant;
    other.adjacent_frames.clear();
    std::ranges::fill(other.frame_of_camera, -1);
    for (const int camera : instant.included_cameras) {
      other.frame_of_camera[camera] = frames[camera];
    }
    if (!other.present_cameras().empty()) instants.push_back(std::move(other));
  }
  return instants;
}

Luma picture_of(const LightFieldFrame& instant, std::size_t camera, const CameraDepths& depths,
                std::atomic<std::int64_t>& pixels_decoded) {
  std::int64_t decoded = 0;
  const auto frame = instant.opaque_frames().fetch(static_cast<int>(camera),
                                                   instant.frame_of_camera[camera], {}, decoded);
  pixels_decoded += decoded;
  const VirtualCamera& pinhole = depths.pinholes[camera];
  const MatchingImage image(*frame, instant.opaque_frames().scale(), instant.rig->cameras[camera],
                            pinhole);
  return {pinhole.width, pinhole.height, image.plane()};
}

/// Returns an instant's depths averaged with those of the adjacent instants, but for imported
/// depths, which stay as they are. Memory: the maps of three instants, and as many cameras at a
/// time as fit `working_bytes`.
std::shared_ptr<const NotedDepths> time_averaged_depths(
    const LightFieldFrame& instant, ResultCache& result_cache, std::size_t working_bytes,
    const DepthEstimationOptions& estimation, bool stores_depths, DepthEstimationStatistics& work) {
  const std::vector<LightFieldFrame> adjacent = adjacent_instants(instant);
  const auto imported = ImportedDepths::of(*instant.take, result_cache);
  if (adjacent.empty() || imported->covers(instant, estimation.regions)) {
    return camera_depths(instant, result_cache, working_bytes, estimation, stores_depths, work);
  }
  std::string key = "steadied " + depth_cache_key(instant, estimation);
  for (const LightFieldFrame& other : adjacent)
    key += " beside " + depth_cache_key(other, estimation);
  return result_cache.get<NotedDepths>(key, [&](std::size_t& bytes) {
    const auto depths_at = [&](const LightFieldFrame& at) {
      return camera_depths(at, result_cache, working_bytes, estimation, stores_depths, work);
    };
    std::vector<std::shared_ptr<const NotedDepths>> adjacent_depths;
    for (const LightFieldFrame& other : adjacent) adjacent_depths.push_back(depths_at(other));
    auto kept = std::make_shared<NotedDepths>(*depths_at(instant));
    CameraDepths& depths = kept->depths;
    const auto tolerance =
        static_cast<float>(estimation.tolerance_px * depths.inverse_depth_per_pixel);
    // Three frames and their pictures, two moved ones with their depths, flow and its scratch.
    constexpr std::size_t kBytesPerPixel = 150;
    std::size_t most = 1;
    for (const InverseDepthMap& map : depths.maps) most = std::max(most, map.values.size());
    const std::size_t in_flight =
        std::clamp<std::size_t>(working_bytes / (most * kBytesPerPixel), 1, depths.maps.size());
    work.bytes = std::max(work.bytes, in_flight * most * kBytesPerPixel);
    std::atomic<std::int64_t> decoded = 0;
    store::use_one_opencv_thread();
    const auto never = [] { return false; };
    parallel_for_in_order(depths.maps.size(), in_flight, never, [&](std::size_t i) {
      if (!instant.is_present(static_cast<int>(i)) || !(tolerance > 0)) return;
      if (imported->has_map(instant, static_cast<int>(i))) return;
      const Luma now = picture_of(instant, i, depths, decoded);
      store::OpticalFlowEstimator flow;
      std::vector<PictureWithDepths> moved;
      for (std::size_t j = 0; j < adjacent.size(); ++j) {
        if (!adjacent[j].is_present(static_cast<int>(i))) continue;
        moved.push_back(moved_along_flow(
            now, {picture_of(adjacent[j], i, depths, decoded), adjacent_depths[j]->depths.maps[i]},
            flow));
      }
      if (moved.empty()) return;
      std::vector<TemporalNeighbour> others;
      for (const PictureWithDepths& other : moved) others.push_back({&other.luma, &other.depths});
      depths.maps[i] = temporal_filter(depths.maps[i], now, others, tolerance);
    });
    work.pixels_decoded += decoded;
    depths.compute_block_nearest();
    bytes = depths.bytes();
    return kept;
  });
}

std::shared_ptr<const NotedDepths> depths_by(const DepthViewOptions& settings,
                                             const LightFieldFrame& instant,
                                             ResultCache& result_cache, std::size_t working_bytes,
                                             DepthEstimationStatistics& work) {
  const auto depths_of = settings.temporal ? time_averaged_depths : camera_depths;
  return depths_of(instant, result_cache, working_bytes, settings.estimation,
                   settings.stores_depths, work);
}

}  // namespace

std::string depth_cache_key(const LightFieldFrame& instant, const DepthEstimationOptions& s) {
  std::string key = fmt::format("camera depths {} {} {} {} {}", s.scene.near, s.scene.far,
                                s.plane_px, s.neighbours, s.support_views);
  for (const int frame : instant.frame_of_camera) key += " " + std::to_string(frame);
  for (const PixelRectangle& part : s.regions) {
    key += fmt::format(" {},{},{},{}", part.left, part.top, part.right, part.bottom);
  }
  return key;
}

std::vector<std::string> depth_notes(const CameraDepths& depths, const LightFieldFrame& instant,
                                     const DepthEstimationOptions& estimation) {
  const double needed = required_plane_count(depths, instant, estimation);
  if (needed <= depth_estimation::kMaxPlanes) return {};
  return {
      fmt::format("depth: {:g} px between planes (plane_px) require up to {:.0f} planes for the "
                  "initial sweep; only {} are used: depths of near objects may be wrong",
                  estimation.plane_px, rounded_for_display(needed), depth_estimation::kMaxPlanes)};
}

/// Returns the hypotheses of the cameras. Their weights are those of a blending field of the view
/// with kHypotheses cameras per tile corner.
FusionInputs fusion_inputs(const DepthViewPlan& plan, const ViewRequest& request) {
  static_assert(kDepthTile == BlendingField::kTile);
  constexpr float kMinShare = 0.2F;
  static_assert(4 * kHypotheses <= kMaxHypotheses,
                "each corner of a tile may select other cameras");
  const LightFieldFrame& instant = request.instant;
  const CameraDepths& depths = *plan.depths;
  const BlendingField field(plan.pinhole, *instant.rig,
                            cameras_with_depths(instant, plan.settings.estimation.regions),
                            plan.range, kHypotheses);
  const auto tiles = static_cast<std::size_t>(field.columns() * field.rows());
  std::map<int, DepthHypotheses> hypotheses;  // by camera
  for (std::size_t tile = 0; tile < tiles; ++tile) {
    const int at = static_cast<int>(tile), columns = field.columns();
    for (const BlendingField::TileCamera& chosen : field.tile(at % columns, at / columns).cameras) {
      DepthHypotheses& hypothesis = hypotheses[chosen.camera];
      hypothesis.map = &depths.maps[chosen.camera];
      hypothesis.camera = &depths.pinholes[chosen.camera];
      hypothesis.nearest = &depths.block_nearest[chosen.camera];
      hypothesis.weights.resize(tiles);
      hypothesis.weights[tile] = chosen.share;
    }
  }
  FusionInputs vote;
  for (auto& [camera, hypothesis] : hypotheses) {
    vote.cameras.push_back(camera);
    vote.hypotheses.push_back(std::move(hypothesis));
  }
  // A surface is half a pixel thick. If no two cameras see from different positions, all depths are
  // equal and any tolerance will do.
  const double per_pixel = depths.inverse_depth_per_pixel;
  const auto thick = static_cast<float>((per_pixel > 0 ? per_pixel : 1) / 2);
  // Keep lines: wires that cover one column of pixels here and two in the next view must not break.
  vote.settings = {thick, kMinShare, thick, request.working_bytes};
  return vote;
}

void fill_unknown_depths(const DepthViewPlan& plan, InverseDepthMap& view_depths) {
  const auto behind = static_cast<float>(plan.range.farthest);
  for (float& depth : view_depths.values)
    if (depth < 0) depth = behind;
}

namespace {

InverseDepthMap depths_of_view(DepthViewPlan& plan, const ViewRequest& request) {
  const VirtualCamera& view = plan.pinhole;
  const FusionInputs vote = fusion_inputs(plan, request);
  const std::size_t bytes = fusion_bytes(view, vote.hypotheses, request.working_bytes);
  plan.work.bytes = std::max(plan.work.bytes, bytes);
  if (bytes > request.working_bytes) plan.notes.push_back(memory_overrun_note("depth", request));
  InverseDepthMap map = fuse_hypotheses(view, vote.hypotheses, vote.settings);
  fill_unknown_depths(plan, map);
  return map;
}

}  // namespace

std::optional<DepthViewPlan> plan_without_depths(const ViewRequest& request) {
  DepthViewOptions settings =
      settings_of(request.options, *request.instant.take, request.use_take_folder);
  settings.estimation.regions = cached_regions(settings, request);
  const rig::Rig& rig = *request.instant.rig;
  const VirtualCamera pinhole = undistorted(
      rig::CameraModel(
          {"view", request.view.width, request.view.height, request.view.intrinsics, {}, {}, {}}),
      request.view.pose);
  const InverseDepthRange range =
      inverse_depth_range_in_view(request.view, rig, settings.estimation.scene);
  if (range.empty()) return std::nullopt;
  return DepthViewPlan{
      settings,
      pinhole,
      range,
      BlendingField(request.view, rig,
                    cameras_with_depths(request.instant, settings.estimation.regions), range,
                    settings.cameras),
      BlendingField::complete(request.view, request.instant, range, settings.cameras),
      nullptr,
      {},
      {},
      {}};
}

std::optional<DepthViewPlan> plan(const ViewRequest& request) {
  std::optional<DepthViewPlan> result = plan_without_depths(request);
  if (!result) return std::nullopt;
  const std::shared_ptr<const NotedDepths> kept = depths_by(
      result->settings, request.instant, request.result_cache, request.working_bytes, result->work);
  result->depths = std::shared_ptr<const CameraDepths>(kept, &kept->depths);
  result->notes = kept->notes;
  result->view_depths = depths_of_view(*result, request);
  return result;
}

std::shared_ptr<const CameraDepths> depths_with_default_options(
    const LightFieldFrame& instant, ResultCache& result_cache, std::size_t working_bytes,
    bool stores_depths, const schemas::DepthRange& scene, DepthEstimationStatistics& work) {
  DepthEstimationOptions estimation;
  estimation.scene = scene;
  const auto found =
      camera_depths(instant, result_cache, working_bytes, estimation, stores_depths, work);
  return {found, &found->depths};
}

float visibility_tolerance(const DepthViewPlan& plan) {
  const double per_pixel = plan.depths->inverse_depth_per_pixel;
  return static_cast<float>(plan.settings.estimation.tolerance_px *
                            (per_pixel > 0 ? per_pixel : 1));
}

float visibility_border(const DepthViewPlan& plan) {
  constexpr float kBorder = 8;  // parts reach at least that far beyond what is needed of them
  return plan.settings.estimation.regions.empty() ? 0 : kBorder;
}

}  // namespace depth

namespace {

class DepthMethod final : public Method {
 public:
  std::string_view name() const override { return "depth"; }
  MethodDescription description() const override {
    return {.summary =
                "blends the cameras that see a point by their depths, which are estimated once per "
                "instant",
            .artefacts = "thin objects may fray",
            .use = "final frames: the most accurate"};
  }
  std::span<const OptionSpec> options() const override { return depth::kOptions; }
  std::span<const MethodPreset> presets() const override {
    static constexpr MethodPreset kPresets[]{{"fast", "cameras=6,soft_edges=false"}};
    return kPresets;
  }
  RenderedView render(const ViewRequest& request) const override {
    const FacetedFrame facets(request.instant);
    return depth::render(request_for(facets.frame(), request));
  }
  RenderedView render_reference(const ViewRequest& request) const override {
    const FacetedFrame facets(request.instant);
    return depth::render_reference(request_for(facets.frame(), request));
  }
  /// Returns kNone for time-averaged depths, because they depend on other light field frames.
  DistributionMode distribution(const MethodOptions& options) const override {
    return options.flag("temporal") ? DistributionMode::kNone : DistributionMode::kLockstep;
  }
  Contribution contribute(const ViewRequest& request) const override {
    const FacetedFrame facets(request.instant);
    return depth::contribute(request_for(facets.frame(), request));
  }
  RenderedView combine(const ViewRequest& request, std::vector<PixelValues> planes) const override {
    const FacetedFrame facets(request.instant);
    return depth::combine(request_for(facets.frame(), request), planes);
  }
  void check(const MethodOptions& options, const store::Take& take) const override {
    depth::settings_of(options, take, false);
  }

  bool stores_data() const override { return true; }
  std::filesystem::path stored_file(const MethodOptions& options,
                                    const LightFieldFrame& whole) const override {
    const FacetedFrame facets(whole);
    const LightFieldFrame& instant = facets.frame();
    depth::DepthViewOptions settings = depth::settings_of(options, *instant.take, true);
    if (!settings.stores_depths) return {};
    settings.estimation.regions = depth::regions_of(settings, instant);
    if (ImportedDepths(*instant.take).covers(instant, settings.estimation.regions)) return {};
    return depth_file_path(instant.derived_folder(), depth_store_key(instant, settings.estimation));
  }
  StoreResult store(const MethodOptions& options, const LightFieldFrame& whole,
                    std::size_t working_bytes) const override {
    const FacetedFrame facets(whole);
    const LightFieldFrame& instant = facets.frame();
    depth::DepthViewOptions settings = depth::settings_of(options, *instant.take, true);
    settings.estimation.regions = depth::regions_of(settings, instant);
    return store_camera_depths(instant, settings.estimation, working_bytes);
  }

  RaySurface surface(const SurfaceRequest& r) const override {
    const depth::DepthViewOptions settings =
        depth::settings_of(r.options, *r.instant.take, r.use_take_folder);
    DepthEstimationStatistics work;
    const auto facets = std::make_shared<const FacetedFrame>(r.instant);
    const LightFieldFrame& instant = facets->frame();
    const auto found = depth::depths_by(settings, instant, r.result_cache, r.working_bytes, work);
    return kept_with(
        facets, depth_surface({found, &found->depths}, *instant.rig, settings.estimation.scene));
  }
  bool uses_focal_plane() const override { return false; }
  bool tells_surfaces_apart() const override { return true; }
  bool reads_adjacent_frames(const MethodOptions& options) const override {
    return options.flag("temporal");
  }
  bool depends_on_shown_views(const MethodOptions& options) const override {
    return !options.flag("temporal") && !options.flag("all_cameras");
  }
};

}  // namespace

const Method& depth_method() {
  static const DepthMethod method;
  return method;
}

}  // namespace raystage::render
