// SPDX-License-Identifier: Apache-2.0
// Renders a view of the method "depth" from its plan (depth_view_plan.cpp). Determines the source
// pixels, decodes them, and per pixel blends the samples of the selected cameras by weight,
// visibility and agreement (blend_kernels.cpp); at edges of depth both surfaces
// (surface_pairs.cpp). Where the cameras disagree about a surface, a fit over their positions
// replaces the mean (angular_fit.cpp). Input: the inverse depth (1/m) of each pixel of the view.
// Output: premultiplied linear RGBA, coverage and planar depth z in metres. Cost: O(pixels x
// cameras of a tile). Reference: depth_reference.cpp.
#include "render/depth/depth.h"

#include <algorithm>
#include <array>
#include <limits>
#include <mutex>
#include <optional>

#include "base/parallel.h"
#include "render/depth/angular_fit.h"
#include "render/depth/blend_kernels.h"
#include "render/depth/surface_pairs.h"
#include "render/depth/view_sources.h"
#include "render/sampling/field_coverage.h"

namespace raystage::render::depth {
namespace {

using Tile = BlendingField::Tile;
static_assert(BlendingField::kTile <= kMaxRunPixels);

class Frame {
 public:
  Frame(const ViewRequest& request, const DepthViewPlan& plan)
      : request_(request),
        view_(request.view),
        plan_(plan),
        separation_(surface_separation(plan, request)),
        sources_(request, plan),
        angular_fit_(request, plan),
        keeps_fits_(view_value_count(request.view) * sizeof(float) <= request.working_bytes) {}

  RenderedView render(RenderClock::time_point start) {
    RenderedView image = uninitialised_view(view_);
    const auto planned = RenderClock::now();
    sources_.decode(image.statistics);
    const auto decoded = RenderClock::now();
    blend(image);
    angular_fit_.strengths().decide();
    fit_where_cameras_disagree(image);
    image.notes = plan_.notes;
    std::size_t kept_bytes = 0;
    for (const TileFits& fits : fits_) kept_bytes += fits.size() * sizeof(float);
    image.statistics.working_bytes = std::max(plan_.work.bytes, kept_bytes);
    image.statistics.pixels_decoded += plan_.work.pixels_decoded;
    image.statistics.plan_ms = milliseconds(planned - start);
    image.statistics.decode_ms = milliseconds(decoded - planned);
    image.statistics.render_ms = milliseconds(RenderClock::now() - decoded);
    if (request_.count_needed_pixels) image.statistics.pixels_needed = count_needed();
    if (request_.measure_coverage) measure_coverage(request_, plan_, image);
    return image;
  }

 private:
  using TileFits = std::vector<float>;  // AngularFitResult::rgba of a tile's rows; empty: not kept

  /// Samples, weights and visibility of all cameras of a run; reused from run to run.
  struct Scratch {
    /// Prepares for the runs of a tile.
    void begin(const Tile& tile, const AngularFit& angular_fit) {
      samples.resize(std::max(samples.size(), tile.cameras.size()));
      weights.resize(samples.size());
      visible.resize(samples.size());
      offsets.clear();
      if (angular_fit.may_fit(tile)) offsets = angular_fit.offsets(tile);
    }
    /// Prepares for a run.
    void clear() {
      sample_of.clear();
      share_of.clear();
      visible_of.clear();
      offset_of.clear();
    }
    /// Returns where the values of the next camera go; `in_tile`: its index.
    CameraRun add_camera(std::size_t in_tile) {
      const std::size_t i = sample_of.size();
      sample_of.push_back(samples[i].data());
      share_of.push_back(weights[i].data());
      visible_of.push_back(visible[i].data());
      if (!offsets.empty()) offset_of.push_back(offsets[in_tile]);
      return {samples[i].data(), weights[i].data(), visible[i].data()};
    }
    AngularFit::Row row(int y) const { return {y, sample_of, share_of, visible_of, offset_of}; }

    std::vector<std::array<float, 4 * kMaxRunPixels>> samples;
    std::vector<std::array<float, kMaxRunPixels>> weights, visible;
    std::vector<std::array<float, kMaxRunPixels>> seen;  // of frames with a matte
    std::array<float, kMaxRunPixels> seen_by_all;        // of these
    std::array<FrontShare, kMaxRunPixels> shares;        // at the front surfaces of pairs
    std::vector<const float*> sample_of, share_of, visible_of;
    std::vector<AngularOffset> offsets, offset_of;  // of the tile's cameras, of the run's
    std::array<float, 4 * kMaxRunPixels> behind;    // colours behind the front surfaces
    std::vector<EdgePixel> edges;                   // of all runs
    TileFits fits;                                  // of the tile, where they were computed
  };

  /// Blends tile by tile, not row by row: adjacent rows read the same source pixels from the cache.
  void blend(RenderedView& image) {
    constexpr int kTiles = 4;
    const std::vector<Tile>& all = plan_.field.tiles();
    fits_.resize(all.size());
    std::mutex edges_mutex;
    raystage::parallel_for(tbb::blocked_range<int>(0, static_cast<int>(all.size()), kTiles),
                           [&](const tbb::blocked_range<int>& tiles) {
                             Scratch scratch;
                             for (int i = tiles.begin(); i < tiles.end(); ++i) {
                               const Tile& tile = all[i];
                               scratch.begin(tile, angular_fit_);
                               blend_tile(tile, fits_[i], scratch, image);
                             }
                             const std::scoped_lock lock(edges_mutex);
                             image.edges.insert(image.edges.end(), scratch.edges.begin(),
                                                scratch.edges.end());
                           });
    std::ranges::sort(image.edges, {}, &EdgePixel::pixel);
  }

  /// Blends a tile. Keeps the fits of its pixels where they are likely to count.
  void blend_tile(const Tile& tile, TileFits& fits, Scratch& scratch, RenderedView& image) {
    if (scratch.offsets.empty()) {
      for (int y = tile.top; y < tile.bottom; ++y) blend_run(tile, y, scratch, nullptr, image);
      return;
    }
    const auto per_row = 4 * static_cast<std::size_t>(tile.right - tile.left);
    const auto rows = static_cast<std::size_t>(tile.bottom - tile.top);
    scratch.fits.resize(per_row * rows);
    const auto of_row = [&](int y) { return &scratch.fits[(y - tile.top) * per_row]; };
    for (int y = tile.top; y < tile.bottom; ++y) {
      if (AngularStrengths::is_measured(y)) blend_run(tile, y, scratch, of_row(y), image);
    }
    const bool keeps = keeps_fits_ && angular_fit_.strengths().may_reach(tile);
    for (int y = tile.top; y < tile.bottom; ++y) {
      if (AngularStrengths::is_measured(y)) continue;
      blend_run(tile, y, scratch, keeps ? of_row(y) : nullptr, image);
    }
    if (keeps) fits = scratch.fits;
  }

  /// Mixes the fit into the pixels where it counts. Samples tiles whose fits were not kept once
  /// more.
  void fit_where_cameras_disagree(RenderedView& image) const {
    const std::vector<Tile>& all = plan_.field.tiles();
    raystage::parallel_for(0, static_cast<int>(all.size()), [&](int i) {
      const Tile& tile = all[i];
      const TileFits& fits = fits_[i];
      if (!angular_fit_.may_fit(tile) || !angular_fit_.strengths().reaches(tile)) return;
      Scratch scratch;
      scratch.begin(tile, angular_fit_);
      const auto n = static_cast<std::size_t>(tile.right - tile.left);
      std::array<float, kMaxRunPixels> strengths;
      std::array<float, 4 * kMaxRunPixels> sums;
      for (int y = tile.top; y < tile.bottom; ++y) {
        if (!angular_fit_.strengths_of_row(tile, y, {strengths.data(), n})) continue;
        AngularFitResult result;
        std::span<const float> fitted(result.rgba);
        if (fits.empty()) {
          sample_row(tile, y, scratch);
          angular_fit_.solve(tile, scratch.row(y), result);
        } else {
          fitted = std::span(fits).subspan(4 * n * static_cast<std::size_t>(y - tile.top), 4 * n);
        }
        weigh_angular_fit(fitted, {strengths.data(), n}, {sums.data(), 4 * n});
        mix_angular_fit(*request_.instant.cache, {sums.data(), 4 * n},
                        {&image.rgba[4 * image.index(tile.left, y)], 4 * n});
      }
    });
  }

  void sample_row(const Tile& tile, int y, Scratch& scratch) const {
    const auto n = static_cast<std::size_t>(tile.right - tile.left);
    const PixelRun pixels{tile.left, y, {&plan_.view_depths.at(tile.left, y), n}};
    scratch.clear();
    for (std::size_t c = 0; c < tile.cameras.size(); ++c) {
      if (!sources_[tile.cameras[c].camera].frame) continue;
      sample_camera(sources_, plan_, tile, tile.cameras[c], pixels, scratch.add_camera(c));
    }
  }

  /// Writes the premultiplied colours of a run's points. `surfaces`: of its pixels, if the points
  /// are those in front; null: those behind. `fits`: if not null, receives the fits of the pixels.
  void blend_points(const Tile& tile, const PixelRun& pixels, const SurfaceRun* surfaces,
                    Scratch& scratch, float* fits, std::span<float> rgba) {
    const std::size_t n = pixels.inverse_depth.size();
    scratch.clear();
    constexpr std::array<float, kMaxRunPixels> kAll = [] {
      std::array<float, kMaxRunPixels> ones{};
      ones.fill(1);
      return ones;
    }();
    const store::FrameCache& cache = *request_.instant.cache;
    const auto full_scale = static_cast<float>(cache.full_scale());
    if (cache.has_matte()) scratch.seen.resize(scratch.samples.size());
    const bool has_pairs = surfaces != nullptr && surfaces->has_pairs();
    if (has_pairs) scratch.shares.fill({});
    scratch.seen_by_all = {};
    for (std::size_t c = 0; c < tile.cameras.size(); ++c) {
      const BlendingField::TileCamera& camera = tile.cameras[c];
      const ViewSources::Source& from = sources_[camera.camera];
      if (!from.frame) continue;
      const std::size_t i = scratch.sample_of.size();
      const CameraRun run = scratch.add_camera(c);
      sample_camera(sources_, plan_, tile, camera, pixels, run);
      if (cache.has_matte()) {
        scratch.seen[i] = {};
        add_visibility_at_depth(from.source, pixels.x, pixels.y, pixels.inverse_depth,
                                {kAll.data(), n}, {scratch.seen[i].data(), n});
      }
      if (has_pairs) {
        const SeenByFrame seen = cache.has_matte() ? SeenByFrame{scratch.seen[i].data(), 1}
                                                   : SeenByFrame{run.samples + 3, 4};
        weigh_front_surfaces(sources_, plan_, camera.camera, pixels, *surfaces, run, seen,
                             scratch.shares);
      }
      for (std::size_t x = 0; cache.has_matte() && x < n; ++x) {
        scratch.seen_by_all[x] += run.weights[x] * run.visible[x] * scratch.seen[i][x];
      }
    }
    if (fits != nullptr) {
      AngularFitResult result;
      angular_fit_.solve(tile, scratch.row(pixels.y), result);
      if (AngularStrengths::is_measured(pixels.y)) angular_fit_.measure(tile, pixels.y, result);
      std::copy_n(result.rgba.data(), 4 * n, fits);
    }
    blend_reweighted({scratch.sample_of, scratch.share_of, scratch.visible_of, static_cast<int>(n),
                      static_cast<float>(plan_.settings.agreement * 257)},
                     rgba);
    if (cache.has_matte()) {
      finish_samples(rgba, {scratch.seen_by_all.data(), n}, cache.blend_space(), full_scale, rgba);
    } else {
      finish_samples(rgba, cache.blend_space(), full_scale, rgba);
    }
  }

  void blend_run(const Tile& tile, int y, Scratch& scratch, float* fits, RenderedView& image) {
    const int count = tile.right - tile.left;
    const auto n = static_cast<std::size_t>(count);
    SurfaceRun surfaces = surfaces_of_run(plan_.view_depths, tile.left, y, count, separation_);
    const std::size_t at = image.index(tile.left, y);
    const std::span<float> rgba(&image.rgba[at * 4], n * 4);
    blend_points(tile, {tile.left, y, {surfaces.front.data(), n}}, &surfaces, scratch, fits, rgba);
    if (surfaces.has_pairs()) {
      const auto begin = static_cast<std::size_t>(surfaces.begin),
                 part = static_cast<std::size_t>(surfaces.end - surfaces.begin);
      blend_points(tile, {tile.left + surfaces.begin, y, {surfaces.behind.data() + begin, part}},
                   nullptr, scratch, nullptr, {scratch.behind.data(), 4 * part});
      for (std::size_t x = begin; x < begin + part; ++x) {
        if (!surfaces.is_pair[x]) continue;
        const std::span<float, 4> pixel(&rgba[4 * x], 4);
        CombinedSurfaces both =
            combine_surfaces({surfaces.front[x], surfaces.behind[x]}, scratch.shares[x], pixel,
                             std::span<const float, 4>(&scratch.behind[4 * (x - begin)], 4));
        std::ranges::copy(both.rgba, pixel.begin());
        surfaces.front[x] = both.inverse_depth;
        if (!both.edge) continue;
        both.edge->pixel = static_cast<std::uint32_t>(at + x);
        scratch.edges.push_back(*both.edge);
      }
    }
    for (std::size_t x = 0; x < n; ++x) {
      const float alpha = rgba[4 * x + 3], depth = surfaces.front[x];
      const float absent = absent_camera_weight(plan_.complete, request_.instant,
                                                tile.left + static_cast<int>(x), y);
      image.coverage[at + x] = alpha * (1 - absent);
      image.z[at + x] = alpha > 0 && depth > 0 ? 1 / depth : std::numeric_limits<float>::infinity();
    }
  }

  std::int64_t count_needed() const {
    std::array<float, BlendingField::kTile> share;
    share.fill(1);
    return sources_.count_marked_pixels([&](int camera, const DepthSource& marking) {
      for (const Tile& tile : plan_.field.tiles()) {
        if (find_camera(tile, camera) == nullptr) continue;
        const auto n = static_cast<std::size_t>(tile.right - tile.left);
        for (int y = tile.top; y < tile.bottom; ++y) {
          const SurfaceRun surfaces =
              surfaces_of_run(plan_.view_depths, tile.left, y, static_cast<int>(n), separation_);
          const auto mark = [&](const auto& depths) {
            mark_samples_at_depth(marking, tile.left, y, {depths.data(), n}, {share.data(), n},
                                  plan_.settings.interpolation);
          };
          mark(surfaces.front);
          if (surfaces.has_pairs()) mark(surfaces.behind);
        }
      }
    });
  }

  const ViewRequest& request_;
  const VirtualCamera& view_;
  const DepthViewPlan& plan_;
  std::optional<float> separation_;  // of two surfaces of a pixel
  ViewSources sources_;
  AngularFit angular_fit_;
  bool keeps_fits_;             // they fit the memory
  std::vector<TileFits> fits_;  // by tile
};

}  // namespace

RenderedView render(const ViewRequest& request) {
  const auto start = RenderClock::now();
  const std::optional<DepthViewPlan> made = plan(request);
  if (!made) return transparent_view(request);
  return Frame(request, *made).render(start);
}

}  // namespace raystage::render::depth
