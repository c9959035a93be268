// SPDX-License-Identifier: Apache-2.0
#include "render/renderer.h"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>
#include <map>
#include <mutex>
#include <numeric>
#include <optional>
#include <stdexcept>
#include <utility>

#include "base/error.h"
#include "base/large_buffer.h"
#include "base/options.h"
#include "base/parallel.h"
#include "render/common/footprint.h"
#include "render/common/light_field_frame.h"
#include "render/common/push_pull.h"
#include "render/confidence.h"
#include "render/lumigraph/lumigraph.h"
#include "render/lumigraph/lumigraph_method.h"
#include "render/methods.h"
#include "store/processing/frames/frame_cache.h"

namespace raystage::render {

struct LightFieldRenderer::State {
  State(const store::Take& of_take, const RendererOptions& with_options)
      : take(of_take),
        settings(with_options),
        result_cache(with_options.result_cache
                         ? with_options.result_cache
                         : std::make_shared<ResultCache>(with_options.result_cache_bytes)),
        interpolated(result_cache->interpolated_frames()),
        cache(of_take, cache_bytes(with_options), with_options.blend_space, with_options.matte,
              interpolated) {
    if (settings.matte) {
      opaque.emplace(take, settings.cache_bytes - cache_bytes(settings), settings.blend_space,
                     nullptr, interpolated);
    }
  }

  static std::size_t cache_bytes(const RendererOptions& settings) {
    return settings.matte ? settings.cache_bytes / 4 * 3 : settings.cache_bytes;
  }

  const store::Take& take;
  RendererOptions settings;
  std::shared_ptr<ResultCache> result_cache;
  std::shared_ptr<store::InterpolatedFrames> interpolated;
  store::FrameCache cache;
  std::optional<store::FrameCache> opaque;  // the frames without their matte
  BufferPool buffers;
  std::vector<int> included_cameras;  // cameras that are not excluded
  std::mutex mutex;
  // By cameras present.
  std::map<std::vector<int>, std::shared_ptr<const rig::Topology>> topologies;

  std::shared_ptr<const rig::Topology> topology(const std::vector<int>& cameras) {
    // Limits takes whose set of present cameras changes at every frame.
    constexpr std::size_t kMax = 64;
    const std::scoped_lock lock(mutex);
    if (topologies.size() >= kMax && !topologies.contains(cameras)) topologies.clear();
    auto& known = topologies[cameras];
    if (!known)
      known = std::make_shared<const rig::Topology>(rig::make_topology(take.rig(), cameras));
    return known;
  }

  std::vector<int> frames_of_members(const store::FrameSelection& frames) const {
    std::vector<int> of_camera(static_cast<std::size_t>(take.camera_count()), -1);
    for (const int camera : included_cameras) {
      const auto i = static_cast<std::size_t>(camera);
      of_camera[i] = frames.frame[i];
      if (!frames.is_interpolated(i) || of_camera[i] < 0) continue;
      const store::FrameSelection::Second& second = frames.second[i];
      of_camera[i] =
          interpolated->number_of({of_camera[i], second.frame, second.part, second.line_part});
    }
    return of_camera;
  }

  std::vector<std::vector<int>> adjacent_frames(const store::FrameSelection& frames) const {
    std::vector<std::vector<int>> beside;
    for (const std::size_t tick : store::adjacent_ticks(settings.ticks, frames)) {
      beside.push_back(frames_of_members(settings.ticks[tick]));
    }
    return beside;
  }

  /// kIntact: without rotten frames of the instant; kIntactWithAdjacent: nor of the adjacent ones.
  enum class Frames { kAll, kIntact, kIntactWithAdjacent };

  bool is_rotten_frame(int camera, int frame) const {
    const store::ArchiveReader& archive = take.archive(camera);
    const auto sources = cache.sources_of(frame);
    if (!sources) return archive.is_rotten(frame);
    return archive.is_rotten(sources->first) || archive.is_rotten(sources->second);
  }

  /// Marks the cameras of rotten frames absent and returns their indices, in increasing order.
  std::vector<int> remove_rotten(std::vector<int>& frame_of_camera) const {
    std::vector<char> is_rotten(frame_of_camera.size(), 0);
    parallel_for(std::size_t{0}, frame_of_camera.size(), [&](std::size_t camera) {
      const int frame = frame_of_camera[camera];
      if (frame < 0 || !is_rotten_frame(static_cast<int>(camera), frame)) return;
      frame_of_camera[camera] = -1;
      is_rotten[camera] = 1;
    });
    std::vector<int> cameras;
    for (std::size_t camera = 0; camera < is_rotten.size(); ++camera) {
      if (is_rotten[camera] != 0) cameras.push_back(static_cast<int>(camera));
    }
    return cameras;
  }

  /// Returns the light field frame, without topologies where no camera is present.
  LightFieldFrame instant(const store::FrameSelection& frames,
                          const std::vector<VirtualCamera>& shown_views = {},
                          Frames which = Frames::kAll) {
    LightFieldFrame instant;
    instant.shown_views = shown_views;
    instant.take = &take;
    instant.time_ns = frames.time_ns;
    instant.rig = &take.rig();
    instant.cache = &cache;
    instant.opaque = opaque ? &*opaque : nullptr;
    instant.fetch_group = cache.new_fetch_group();
    instant.frame_of_camera = frames_of_members(frames);
    instant.adjacent_frames = adjacent_frames(frames);
    instant.included_cameras = included_cameras;
    if (which != Frames::kAll) {
      instant.rotten_cameras = remove_rotten(instant.frame_of_camera);
    }
    if (which == Frames::kIntactWithAdjacent) {
      for (std::vector<int>& beside : instant.adjacent_frames) {
        const std::vector<int> more = remove_rotten(beside),
                               of_instant = std::move(instant.rotten_cameras);
        instant.rotten_cameras.clear();
        std::ranges::set_union(of_instant, more, std::back_inserter(instant.rotten_cameras));
      }
    }
    instant.cache_folder = settings.cache_folder;
    instant.stored_data_counts = settings.stored_data_counts.get();
    const std::vector<int> present = instant.present_cameras();
    if (present.empty()) return instant;
    instant.present = topology(present);
    instant.complete = present == included_cameras ? instant.present : topology(included_cameras);
    return instant;
  }

  /// Returns work(instant). Where that reads a rotten frame, it is done again without such frames;
  /// without any frame left it throws.
  template <class Work>
  auto with_intact_frames(const store::FrameSelection& frames,
                          const std::vector<VirtualCamera>& shown_views, bool reads_adjacent_frames,
                          const Work& work) {
    LightFieldFrame intact;
    try {
      return work(instant(frames, shown_views));
    } catch (const store::RottenFrame&) {
      if (settings.rotten_frames == store::RottenFrames::kError || settings.hosts) throw;
      intact = instant(frames, shown_views,
                       reads_adjacent_frames ? Frames::kIntactWithAdjacent : Frames::kIntact);
      if (!intact.present) throw;
    }
    return work(intact);
  }

  /// Computes the weights of all cameras: their contribution with white frames.
  void add_weights(const Method& method, const ViewRequest& request, Contribution& all) const {
    store::FrameCache white = store::FrameCache::white(take, cache.blend_space());
    LightFieldFrame of_white = request.instant;
    of_white.cache = &white;
    ResultCache none(0);
    const Contribution weights =
        method.contribute({request.view, of_white, request.focal_plane, request.options, none,
                           request.working_bytes, request.buffers, false, false, false,
                           request.supersampling, request.first_row, request.full_height});
    for (std::size_t plane = 0; plane < all.planes.size(); ++plane) {
      const PixelValues& from = weights.planes.at(plane);
      for (std::size_t i = 3; i < from.size(); i += 4) all.planes[plane][i] = from[i];
    }
  }

  /// Returns the selection of an instant's frames; the numbers of interpolated ones are known here
  /// only.
  store::FrameSelection selection_of(const LightFieldFrame& instant) const {
    store::FrameSelection frames{instant.time_ns, {}, {}, {}};
    const std::vector<int>& of_camera = instant.frame_of_camera;
    frames.frame.assign(of_camera.begin(), of_camera.end());
    for (std::size_t camera = 0; camera < of_camera.size(); ++camera) {
      const auto sources = cache.sources_of(of_camera[camera]);
      if (!sources) continue;
      frames.second.resize(of_camera.size());
      frames.frame[camera] = sources->first;
      frames.second[camera] = {sources->second, sources->part, sources->line_part};
    }
    return frames;
  }

  /// Returns the view from all ranks' contributions.
  RenderedView render_together(const Method& method, const ViewRequest& request,
                               const ReconstructionOptions& reconstruction) const {
    DistributedViewRequest asked{request.view,
                                 {},
                                 request.instant.adjacent_frames,
                                 request.instant.shown_views,
                                 reconstruction.method,
                                 reconstruction.options,
                                 reconstruction.focal_plane,
                                 request.supersampling,
                                 request.first_row,
                                 request.full_height};
    asked.frames = selection_of(request.instant);
    asked.is_lockstep = method.distribution(request.options) == DistributionMode::kLockstep;
    Contribution all = settings.hosts->sum(asked, [&](const RankCommunicator* group) {
      LightFieldFrame own = request.instant;
      own.rank_of_camera = settings.rank_of_camera;
      own.this_rank = settings.this_rank;
      return method.contribute({request.view, own, request.focal_plane, request.options,
                                request.result_cache, request.working_bytes, request.buffers,
                                request.count_needed_pixels, false, request.use_take_folder,
                                request.supersampling, request.first_row, request.full_height,
                                group});
    });
    if (settings.hosts->omits_weights(asked)) add_weights(method, request, all);
    RenderedView image = method.combine(request, std::move(all.planes));
    const RenderStatistics& sampled = all.statistics;
    image.statistics.plan_ms += sampled.plan_ms;
    image.statistics.decode_ms += sampled.decode_ms;
    image.statistics.render_ms += sampled.render_ms;
    image.statistics.pixels_decoded = sampled.pixels_decoded;
    image.statistics.pixels_needed = sampled.pixels_needed;
    image.statistics.cameras_used = sampled.cameras_used;
    image.statistics.working_bytes =
        std::max(image.statistics.working_bytes, sampled.working_bytes);
    return image;
  }
};

namespace {

bool is_summed(DistributionMode distribution) {
  return distribution == DistributionMode::kContributions ||
         distribution == DistributionMode::kLockstep;
}

/// Returns the bytes per pixel of a RenderedView, with the measures that the request and the method
/// require.
std::size_t bytes_per_pixel(const Method& method, const RendererOptions& settings) {
  return view_buffer_bytes({1, 1, {}, {}}) + (settings.measure_coverage ? 2 * sizeof(float) : 0) +
         (settings.measure_confidence ? sizeof(float) : 0) +
         (method.marks_empty_space() ? sizeof(float) : 0) +
         (method.tells_surfaces_apart() ? sizeof(EdgePixel) / 4 : 0);  // a quarter of the pixels
}

std::size_t pixels_of(const VirtualCamera& view) {
  return static_cast<std::size_t>(view.width) * view.height;
}

/// Returns the samples per axis for a pixel that covers `ratio` pixels of the cameras. Steps of up
/// to 1.5 camera pixels are allowed, because linear interpolation reads two pixels anyway.
int wanted_supersampling(double ratio) {
  return std::max(1, static_cast<int>(std::min(ratio, 64.0) + 0.5));
}

bool is_row_independent(const Method& method, const MethodOptions& options,
                        const VirtualCamera& view) {
  return method.is_row_independent(options) && view.intrinsics.distortion == schemas::Distortion{};
}

/// How a view is sampled: `factor` times along each axis, `rows` of its rows at a time.
struct Sampling {
  int factor = 1, rows = 0;
};

/// Returns how to sample a view. The limit ignores requested measures, because they must not change
/// pixels.
Sampling sampling_of(double ratio, const VirtualCamera& view, const RendererOptions& settings,
                     const ReconstructionOptions& reconstruction, bool row_independent) {
  const int most_samples = std::min(settings.max_supersampling, reconstruction.max_supersampling);
  int factor = std::min(wanted_supersampling(ratio), std::clamp(most_samples, 1, 64));
  const auto row_bytes = [&] {
    const VirtualCamera row = crop_rows(view, 0, 1);
    return view_buffer_bytes(row) * static_cast<std::size_t>(factor * factor);
  };
  const std::size_t most = settings.supersampling_bytes;
  if (row_independent && factor > 1) {
    std::size_t rows = std::max<std::size_t>(1, most / row_bytes());
    // Bands consist of whole tiles, between whose corners weights are interpolated.
    const auto tile =
        static_cast<std::size_t>(kBlendingTileSize / std::gcd(kBlendingTileSize, factor));
    if (rows > tile) rows -= rows % tile;
    return {factor,
            static_cast<int>(std::min<std::size_t>(rows, static_cast<std::size_t>(view.height)))};
  }
  while (factor > 1 && row_bytes() * static_cast<std::size_t>(view.height) > most) --factor;
  return {factor, view.height};
}

/// Returns source_pixels_per_pixel() on the focal plane, or on the plane of eq. 2.2 for methods
/// that estimate depth. Where that plane is not in view, the plane at infinity is used.
double filtered_pixels(const VirtualCamera& view, const LightFieldFrame& instant,
                       const Method& method, const Eigen::Vector4d& focal_plane) {
  Eigen::Vector4d plane = focal_plane;
  const auto scene = instant.take->document().depth_range;
  if (!method.uses_focal_plane() && scene) {
    plane = rig::fronto_parallel_plane(*instant.rig, rig::optimal_focal_depth(*scene));
  }
  const double ratio = source_pixels_per_pixel(view, instant, plane);
  return ratio > 0 ? ratio : source_pixels_per_pixel(view, instant, {0, 0, 0, 1});
}

/// A method and its options.
struct ChosenMethod {
  const Method& method;
  MethodOptions options;
};

ChosenMethod chosen_by(const ReconstructionOptions& reconstruction) {
  const Method& method = method_named(reconstruction.method);
  return {method, {method.options(), reconstruction.options, "method " + reconstruction.method}};
}

/// Returns the method that answers single rays.
ChosenMethod chosen_for_rays(const ReconstructionOptions& reconstruction) {
  ChosenMethod chosen = chosen_by(reconstruction);
  const RayDelegate stand_in = chosen.method.ray_delegate(chosen.options);
  if (stand_in.method.empty()) return chosen;
  const Method& method = method_named(stand_in.method);
  return {method, {method.options(), stand_in.options, "method " + reconstruction.method}};
}

/// Returns the method whose stored data a query of this kind needs.
ChosenMethod storing(const ReconstructionOptions& reconstruction, QueryKind as) {
  return as == QueryKind::kViews ? chosen_by(reconstruction) : chosen_for_rays(reconstruction);
}

/// Returns the views for which data is stored; rays may pass anywhere.
std::vector<VirtualCamera> views_shown(const ReconstructionOptions& reconstruction, QueryKind as) {
  return as == QueryKind::kViews ? reconstruction.shown_views : std::vector<VirtualCamera>();
}

}  // namespace

void check_ray_query_support(const ReconstructionOptions& reconstruction) {
  const ChosenMethod chosen = chosen_by(reconstruction);
  chosen.method.check_ray_support(chosen.options);
}

bool RendererOptions::is_valid(std::string* reason) const {
  return is_within("max_supersampling", max_supersampling, 1, 64, reason);
}

LightFieldRenderer::LightFieldRenderer(const store::Take& take, const RendererOptions& settings)
    : state_(std::make_unique<State>(take, settings)) {
  for (int camera = 0; camera < take.camera_count(); ++camera) {
    const auto& excluded_cameras = settings.excluded_cameras;
    if (std::find(excluded_cameras.begin(), excluded_cameras.end(), camera) ==
        excluded_cameras.end()) {
      state_->included_cameras.push_back(camera);
    }
  }
  if (state_->included_cameras.empty()) {
    throw Error::bad_input("all cameras are excluded", take.folder().string(),
                           "Include at least one camera");
  }
}

LightFieldRenderer::~LightFieldRenderer() = default;

RenderedView LightFieldRenderer::render(const VirtualCamera& view,
                                        const store::FrameSelection& frames,
                                        const ReconstructionOptions& reconstruction) const {
  const ChosenMethod chosen = chosen_by(reconstruction);
  if (state_->settings.measure_coverage && !chosen.method.measures_coverage()) {
    throw Error::bad_input("method " + reconstruction.method + " does not support coverage",
                           "method", "Do not request coverage, or choose another method")
        .concerning({"coverage"});
  }
  const bool reads_adjacent = chosen.method.reads_adjacent_frames(chosen.options);
  return state_->with_intact_frames(
      frames, reconstruction.shown_views, reads_adjacent, [&](const LightFieldFrame& instant) {
        RenderedView image = render_instant(view, instant, reconstruction);
        image.rotten_cameras = instant.rotten_cameras;
        return image;
      });
}

RenderedView LightFieldRenderer::render_instant(const VirtualCamera& view,
                                                const LightFieldFrame& instant,
                                                const ReconstructionOptions& reconstruction) const {
  const ChosenMethod chosen = chosen_by(reconstruction);
  const Method& method = chosen.method;
  const MethodOptions& options = chosen.options;
  if (!instant.present) {
    RenderedView nothing = empty_view(view);
    if (state_->settings.measure_confidence) nothing.confidence = nothing.coverage;
    if (state_->settings.measure_coverage) clear_coverage_measures(nothing);
    return nothing;
  }

  const double ratio = filtered_pixels(view, instant, method, reconstruction.focal_plane);
  const auto [factor, rows] = sampling_of(ratio, view, state_->settings, reconstruction,
                                          is_row_independent(method, options, view));
  const bool distorted = !(view.intrinsics.distortion == schemas::Distortion{});
  const bool by_reference = state_->settings.reference || distorted;
  const bool is_together =
      state_->settings.hosts != nullptr && is_summed(method.distribution(options));
  const auto render_rows = [&, factor = factor](int first, int end) {
    const VirtualCamera fine = supersampled(crop_rows(view, first, end), factor);
    const ViewRequest request{fine,
                              instant,
                              reconstruction.focal_plane,
                              options,
                              *state_->result_cache,
                              state_->settings.working_bytes,
                              state_->buffers,
                              state_->settings.count_needed_pixels,
                              state_->settings.measure_coverage,
                              state_->settings.use_take_folder,
                              factor,
                              first,
                              view.height};
    RenderedView image = by_reference  ? method.render_reference(request)
                         : is_together ? state_->render_together(method, request, reconstruction)
                                       : method.render(request);
    if (state_->settings.measure_confidence) {
      (by_reference ? measure_confidence_reference : measure_confidence)(fine, instant, image);
    }
    return factor > 1 ? downsampled(image, factor) : std::move(image);
  };
  RenderedView image;
  if (rows == view.height) {
    image = render_rows(0, view.height);
  } else {
    for (int first = 0; first < view.height; first += rows) {
      insert_rows(render_rows(first, std::min(first + rows, view.height)), first, view.height,
                  image);
    }
  }
  if (distorted) {
    image.notes.emplace_back(
        "the view's lens distorts: each ray was computed by the slow reference; the times do not "
        "apply to other views");
  }
  if (reconstruction.fill == schemas::HoleFill::kPushPull) {
    const auto fill = state_->settings.reference ? fill_push_pull_reference : fill_push_pull;
    fill(image);
    fill_behind_edges(image);
  }
  image.statistics.source_pixels_per_pixel = ratio;
  image.statistics.supersampling = factor;
  if (factor < wanted_supersampling(ratio)) {  // the limit is the same for every frame of a shot
    image.notes.push_back(fmt::format(
        "the view has less resolution than the cameras and {} per pixel and axis, fewer "
        "than needed: fine patterns may alias. Render it larger and scale it down",
        factor == 1 ? "1 sample" : fmt::format("{} samples", factor)));
  }
  if (const double halves = std::floor(2 / ratio); ratio > 0 && halves >= 3) {
    image.notes.push_back(
        fmt::format("the view has more resolution than the light field: a pixel of the cameras "
                    "covers at least {:g} pixels of the view along each axis",
                    halves / 2));
  }
  return image;
}

Contribution LightFieldRenderer::contribute(const DistributedViewRequest& view,
                                            const RankCommunicator* group) const {
  const Method& method = method_named(view.method);
  const MethodOptions options(method.options(), view.options, "method " + view.method);
  LightFieldFrame instant = state_->instant(view.frames);
  instant.adjacent_frames = view.adjacent_frames;
  instant.shown_views = view.shown_views;
  instant.rank_of_camera = state_->settings.rank_of_camera;
  instant.this_rank = state_->settings.this_rank;
  if (!instant.present) throw std::logic_error("a view without cameras");
  return method.contribute({view.view, instant, view.focal_plane, options, *state_->result_cache,
                            state_->settings.working_bytes, state_->buffers, false, false,
                            state_->settings.use_take_folder, view.supersampling, view.first_row,
                            view.full_height, group});
}

std::size_t LightFieldRenderer::view_bytes(const VirtualCamera& view,
                                           const store::FrameSelection& frames,
                                           const ReconstructionOptions& reconstruction) const {
  const LightFieldFrame instant = state_->instant(frames);
  const auto& [method, options] = chosen_by(reconstruction);
  const double ratio =
      instant.present ? filtered_pixels(view, instant, method, reconstruction.focal_plane) : 0;
  const Sampling sampling = sampling_of(ratio, view, state_->settings, reconstruction,
                                        is_row_independent(method, options, view));
  const std::size_t of_pixel = bytes_per_pixel(method, state_->settings);
  const std::size_t bytes = pixels_of(view) * of_pixel;
  if (sampling.factor == 1) return bytes;
  const VirtualCamera fine = supersampled(crop_rows(view, 0, sampling.rows), sampling.factor);
  const std::size_t part =
      sampling.rows < view.height ? pixels_of(crop_rows(view, 0, sampling.rows)) : 0;
  return bytes + (pixels_of(fine) + part) * of_pixel;  // samples and their mean
}

std::vector<int> LightFieldRenderer::query(std::span<const WorldRay> rays,
                                           const store::FrameSelection& frames,
                                           const ReconstructionOptions& reconstruction,
                                           std::span<RaySample> samples) const {
  check_ray_query_support(reconstruction);
  const ChosenMethod chosen = chosen_for_rays(reconstruction);
  const Method& method = chosen.method;
  const MethodOptions& options = chosen.options;
  const bool reads_adjacent = method.reads_adjacent_frames(options);
  return state_->with_intact_frames(
      frames, {}, reads_adjacent, [&](const LightFieldFrame& instant) {
        std::fill(samples.begin(), samples.end(), RaySample{});
        if (!instant.present) return instant.rotten_cameras;
        const RaySurface surface =
            method.surface({options, instant, reconstruction.focal_plane, *state_->result_cache,
                            state_->settings.working_bytes, state_->settings.use_take_folder,
                            state_->settings.reference});
        const RayWeightOptions weighing = ray_weight_options(
            method.has_ray_weights()
                ? options
                : MethodOptions(lumigraph_method().options(), {}, "method lumigraph"));
        const auto answer = state_->settings.reference ? query_rays_reference : query_rays;
        answer(rays, instant, surface, weighing, samples);
        return instant.rotten_cameras;
      });
}

std::filesystem::path LightFieldRenderer::stored_file(const store::FrameSelection& frames,
                                                      const ReconstructionOptions& reconstruction,
                                                      QueryKind as) const {
  if (!state_->settings.use_take_folder) return {};
  const ChosenMethod chosen = storing(reconstruction, as);
  const bool reads_adjacent = chosen.method.reads_adjacent_frames(chosen.options);
  try {
    return state_->with_intact_frames(frames, views_shown(reconstruction, as), reads_adjacent,
                                      [&](const LightFieldFrame& instant) {
                                        return instant.present ? chosen.method.stored_file(
                                                                     chosen.options, instant)
                                                               : std::filesystem::path();
                                      });
  } catch (const store::RottenFrame&) {
    return {};  // nothing can be derived; rendering such an instant fails
  }
}

StoreResult LightFieldRenderer::store(const store::FrameSelection& frames,
                                      const ReconstructionOptions& reconstruction,
                                      QueryKind as) const {
  if (stored_file(frames, reconstruction, as).empty()) return {};
  const ChosenMethod chosen = storing(reconstruction, as);
  const bool reads_adjacent = chosen.method.reads_adjacent_frames(chosen.options);
  return state_->with_intact_frames(
      frames, views_shown(reconstruction, as), reads_adjacent, [&](const LightFieldFrame& instant) {
        return chosen.method.store(chosen.options, instant, state_->settings.working_bytes);
      });
}

void LightFieldRenderer::read_ahead(const store::FrameSelection& frames) const {
  for (const int camera : state_->included_cameras) {
    const int frame = frames.frame[camera];
    if (frame >= 0) state_->cache.read_ahead(camera, frame);
    if (frames.is_interpolated(camera)) {
      state_->cache.read_ahead(camera, frames.second[camera].frame);
    }
  }
}

int LightFieldRenderer::frames_read_ahead() const { return state_->cache.frames_read_ahead(); }

store::DecodeCosts LightFieldRenderer::decode_costs() const {
  store::DecodeCosts costs = state_->cache.decode_costs();
  if (state_->opaque) costs += state_->opaque->decode_costs();
  return costs;
}

std::size_t LightFieldRenderer::decoded_bytes_cached() const {
  return state_->cache.bytes_held() + (state_->opaque ? state_->opaque->bytes_held() : 0);
}

}  // namespace raystage::render
