// SPDX-License-Identifier: Apache-2.0
// Renders a view by plane sweep (Yang, Welch and Bishop 2002; Zhang and Chen 2004; thesis,
// Reconstruction). Determines the source pixels per tile, decodes them and fills a cost volume of
// planes evenly spaced in inverse depth (cost_kernels.cpp). Selects a plane per pixel (matching),
// and blends the cameras at the depths found (1/m). Output: premultiplied linear RGBA, coverage, z
// in metres. Cost: O(pixels x planes x cameras of a tile), twice with an edge guide. Reference:
// plane_sweep_reference.cpp.
#include "render/sweep/plane_sweep.h"

#include <tbb/enumerable_thread_specific.h>
#include <tbb/task_arena.h>

#include <algorithm>
#include <limits>

#include "base/parallel.h"
#include "matching/matching.h"
#include "render/common/memory_overrun_note.h"
#include "render/sampling/field_coverage.h"
#include "render/sampling/field_sources.h"
#include "render/sweep/cost_kernels.h"
#include "render/sweep/edge_guide.h"
#include "render/sweep/inlier_selection.h"

namespace raystage::render::plane_sweep {
namespace {

using Tile = BlendingField::Tile;

class Frame {
 public:
  Frame(const ViewRequest& request, const PlaneSweepPlan& plan)
      : request_(request),
        view_(request.view),
        plan_(plan),
        planes_(plan.planes.from_farthest()),
        scratch_([&plan] { return CostScratch(plan.planes.count, plan.settings.cameras); }),
        sources_(request.view, request.instant, plan.field,
                 std::vector<InverseDepthRange>(plan.field.tiles().size(),
                                                {planes_.farthest, planes_.nearest()}),
                 plan.planes.farthest, plan.settings.interpolation),
        matching_(sources_.size()) {}

  RenderedView render(RenderClock::time_point start) {
    RenderedView image = empty_view(view_);
    image.notes = plan_.notes;
    const auto planned = RenderClock::now();
    sources_.decode(image.statistics);
    make_matching_frames();
    const auto decoded = RenderClock::now();
    matching::PlaneMap map = match({}, image.statistics);
    if (plan_.settings.edge_scale > 0 && plan_.planes.count > 1) {
      const std::vector<std::uint8_t> guide = guide_from(map, image.statistics);
      map = {};
      map = match(guide, image.statistics);
    }
    if (image.statistics.working_bytes > request_.working_bytes) {
      image.notes.push_back(memory_overrun_note("plane_sweep", request_));
    }
    blend(map, image);
    image.statistics.plan_ms = milliseconds(planned - start);
    image.statistics.decode_ms = milliseconds(decoded - planned);
    image.statistics.render_ms = milliseconds(RenderClock::now() - decoded);
    if (request_.count_needed_pixels) image.statistics.pixels_needed = count_needed(map);
    if (request_.measure_coverage) measure_view_coverage(request_, plan_.field, {}, image);
    return image;
  }

 private:
  /// A camera as it is matched.
  struct Matching {
    MatchingFrame frame;
    MatchingCamera camera;
  };

  static FrameBox wanted_box(const FieldSources::Source& source) {
    const SourceView& view = source.source.camera;
    FrameBox mcus{view.mcus_per_row, 0, std::numeric_limits<int>::max(), 0};
    for (std::size_t i = 0; i < source.wanted.size(); ++i) {
      if (source.wanted[i] == 0) continue;
      const int column = static_cast<int>(i) % view.mcus_per_row;
      const int row = static_cast<int>(i) / view.mcus_per_row;
      mcus = {std::min(mcus.left, column), std::max(mcus.right, column + 1),
              std::min(mcus.top, row), std::max(mcus.bottom, row + 1)};
    }
    return {mcus.left << view.mcu_width_log2,
            std::min(mcus.right << view.mcu_width_log2, view.width),
            mcus.top << view.mcu_height_log2,
            std::min(mcus.bottom << view.mcu_height_log2, view.height)};
  }

  /// Converts the decoded frames for matching.
  void make_matching_frames() {
    raystage::parallel_for(std::size_t{0}, sources_.size(), [&](std::size_t i) {
      const FieldSources::Source& s = sources_[i];
      if (!s.frame) return;
      if (plan_.planes.count > 1) {
        matching_[i].frame =
            MatchingFrame(*s.frame, request_.instant.cache->scale(), wanted_box(s));
      }
      matching_[i].camera = {s.source, &matching_[i].frame};
    });
  }

  void fill_row(int y, std::uint8_t* costs) {
    CostScratch& scratch = scratch_.local();
    CostRun run;
    run.y = y;
    run.planes = planes_;
    run.truncation = plan_.settings.truncation;
    run.excluded_cameras = plan_.settings.excluded_cameras;
    const std::ptrdiff_t stride = matching::plane_stride(plan_.planes.count);
    std::vector<const MatchingCamera*> cameras;
    for (int column = 0; column < plan_.field.columns(); ++column) {
      const Tile& tile = plan_.field.tile(column, y / BlendingField::kTile);
      cameras.clear();
      for (const int camera : tile.best) {
        if (sources_[camera].frame) cameras.push_back(&matching_[camera].camera);
      }
      run.begin = tile.left;
      run.end = tile.right;
      run.cameras = cameras;
      run.costs = costs + tile.left * stride;
      compute_matching_costs(run, scratch);
    }
  }

  std::size_t pixels() const { return static_cast<std::size_t>(view_.width) * view_.height; }
  /// Returns the bytes of the matching frames and of a map of planes.
  std::size_t frames_and_map_bytes() const {
    std::size_t bytes = pixels() * (sizeof(float) + 1);
    for (std::size_t i = 0; i < sources_.size(); ++i) {
      if (sources_[i].frame) bytes += MatchingFrame::bytes(matching_[i].frame.box());
    }
    return bytes;
  }
  static void hold(std::size_t bytes, RenderStatistics& statistics) {
    statistics.working_bytes = std::max(statistics.working_bytes, bytes);
  }

  /// Returns the edge guide of the view blended at the planes of `map`.
  std::vector<std::uint8_t> guide_from(const matching::PlaneMap& map,
                                       RenderStatistics& statistics) {
    // Per pixel: the picture and its guide.
    constexpr std::size_t kPictureBytes = 6 * sizeof(float) + 1;
    hold(frames_and_map_bytes() + kPictureBytes * pixels(), statistics);
    RenderedView picture = empty_view(view_);
    blend(map, picture);
    return edge_guide(picture, request_.instant.cache->scale());
  }

  matching::PlaneMap match(std::span<const std::uint8_t> guide, RenderStatistics& statistics) {
    const matching::CostVolume volume{view_.width, view_.height, plan_.planes.count};
    const PlaneSweepOptions& s = plan_.settings;
    if (volume.planes == 1) return {view_.width, view_.height};
    const std::size_t held = frames_and_map_bytes() + guide.size();
    const matching::FillCosts fill = [&](int y, std::span<std::uint8_t> costs) {
      fill_row(y, costs.data());
    };
    if (s.aggregation != Aggregation::kSemiGlobal) {
      const int radius = s.aggregation == Aggregation::kBox ? s.box_radius : 0;
      hold(held + matching::box_bytes(volume, radius, tbb::this_task_arena::max_concurrency()),
           statistics);
      return matching::box_match(volume, fill, radius, s.subplane_refinement);
    }
    matching::SemiGlobalOptions settings = semi_global_options(s, guide);
    settings.buffers = &request_.buffers;
    settings.working_bytes = request_.working_bytes - std::min(request_.working_bytes, held);
    hold(held + matching::semi_global_bytes(volume, settings.working_bytes), statistics);
    return matching::semi_global_match(volume, fill, settings);
  }

  /// Converts planes to inverse depths relative to the farthest plane, 1/m.
  void find_depths(const matching::PlaneMap& map, const Tile& tile, int y,
                   float* inverse_depth) const {
    const float* plane = &map.plane[static_cast<std::size_t>(y) * view_.width + tile.left];
    for (int i = 0; i < tile.right - tile.left; ++i) {
      inverse_depth[i] = static_cast<float>(planes_.inverse_depth(static_cast<double>(plane[i])));
    }
  }

  void blend(const matching::PlaneMap& map, RenderedView& image) {
    raystage::parallel_for(0, view_.height, [&](int y) {
      std::array<float, BlendingField::kTile> inverse_depth;
      std::vector<float> samples;
      Mattes mattes;
      for (int column = 0; column < plan_.field.columns(); ++column) {
        const Tile& tile = plan_.field.tile(column, y / BlendingField::kTile);
        const auto n = static_cast<std::size_t>(tile.right - tile.left);
        const std::size_t at = image.index(tile.left, y);
        find_depths(map, tile, y, inverse_depth.data());
        const std::span<float> rgba(&image.rgba[at * 4], n * 4);
        if (plan_.settings.excluded_cameras == 0) {
          for (const auto& camera : tile.cameras) {
            add_samples(tile, camera, y, {inverse_depth.data(), n}, rgba);
          }
        } else {
          samples.assign(rgba.size() * tile.cameras.size(), 0);
          for (std::size_t i = 0; i < tile.cameras.size(); ++i) {
            add_samples(tile, tile.cameras[i], y, {inverse_depth.data(), n},
                        std::span(samples).subspan(i * rgba.size(), rgba.size()));
          }
          add_inlier_samples(samples, plan_.settings.excluded_cameras, rgba);
        }
        if (has_matte()) find_mattes(tile, y, {inverse_depth.data(), n}, samples, rgba, mattes);
        finish(rgba, {mattes.seen.data(), has_matte() ? n : 0}, {inverse_depth.data(), n},
               tile.left, y, at, image);
      }
    });
  }

  void add_samples(const Tile& tile, const BlendingField::TileCamera& camera, int y,
                   std::span<const float> inverse_depth, std::span<float> sums) {
    const FieldSources::Source& from = sources_[camera.camera];
    if (!from.frame) return;
    std::array<float, BlendingField::kTile> share;
    for (std::size_t i = 0; i < inverse_depth.size(); ++i) {
      share[i] = BlendingField::share(tile, camera, tile.left + static_cast<int>(i), y);
    }
    add_samples_at_depth(from.source, tile.left, y, inverse_depth,
                         {share.data(), inverse_depth.size()}, plan_.settings.interpolation, sums);
  }

  bool has_matte() const { return request_.instant.cache->has_matte(); }

  struct Mattes {
    std::array<float, BlendingField::kTile> seen, share, alpha;
  };

  /// Fills `seen` over all cameras. If cameras were excluded for their colours, scales `sums` to
  /// the mean of the others times the A of all.
  void find_mattes(const Tile& tile, int y, std::span<const float> inverse_depth,
                   std::span<const float> samples, std::span<float> sums, Mattes& mattes) {
    mattes.seen = {};
    for (const auto& camera : tile.cameras) {
      const FieldSources::Source& from = sources_[camera.camera];
      if (!from.frame) continue;
      for (std::size_t i = 0; i < inverse_depth.size(); ++i) {
        mattes.share[i] = BlendingField::share(tile, camera, tile.left + static_cast<int>(i), y);
      }
      add_visibility_at_depth(from.source, tile.left, y, inverse_depth,
                              {mattes.share.data(), inverse_depth.size()},
                              {mattes.seen.data(), inverse_depth.size()});
    }
    if (plan_.settings.excluded_cameras == 0) return;
    mattes.alpha = {};
    for (std::size_t at = 0; at < samples.size(); at += 4) {
      mattes.alpha[at % sums.size() / 4] += samples[at + 3];
    }
    for (std::size_t i = 0; i < inverse_depth.size(); ++i) {
      float* sum = &sums[4 * i];
      const float scale = sum[3] > 0 ? mattes.alpha[i] / sum[3] : 0;
      for (int c = 0; c < 4; ++c) sum[c] *= scale;
    }
  }

  /// Converts sums to pixels. `seen`: of frames with a matte.
  void finish(std::span<float> rgba, std::span<const float> seen,
              std::span<const float> inverse_depth, int x, int y, std::size_t at,
              RenderedView& image) const {
    const store::FrameCache& cache = *request_.instant.cache;
    finish_samples(rgba, seen, cache.blend_space(), static_cast<float>(cache.full_scale()), rgba);
    for (std::size_t i = 0; i < inverse_depth.size(); ++i) {
      const float alpha = rgba[4 * i + 3];
      const float absent =
          absent_camera_weight(plan_.complete, request_.instant, x + static_cast<int>(i), y);
      image.coverage[at + i] = alpha * (1 - absent);
      const double depth = 1 / (plan_.planes.farthest + static_cast<double>(inverse_depth[i]));
      image.z[at + i] =
          alpha > 0 ? static_cast<float>(depth) : std::numeric_limits<float>::infinity();
    }
  }

  std::int64_t count_needed(const matching::PlaneMap& map) const {
    return sources_.count_marked_pixels([&](int camera, const DepthSource& marking) {
      std::array<float, BlendingField::kTile> inverse_depth, share;
      const auto mark = [&](const Tile& tile, int y, Interpolation interpolation) {
        const auto n = static_cast<std::size_t>(tile.right - tile.left);
        mark_samples_at_depth(marking, tile.left, y, {inverse_depth.data(), n}, {share.data(), n},
                              interpolation);
      };
      for (const Tile& tile : plan_.field.tiles()) {
        const BlendingField::TileCamera* found = find_camera(tile, camera);
        if (found == nullptr) continue;
        const bool matched =
            plan_.planes.count > 1 && std::ranges::binary_search(tile.best, camera);
        for (int y = tile.top; y < tile.bottom; ++y) {
          find_depths(map, tile, y, inverse_depth.data());
          for (int x = tile.left; x < tile.right; ++x) {
            share[x - tile.left] = BlendingField::share(tile, *found, x, y);
          }
          mark(tile, y, plan_.settings.interpolation);
          share.fill(1);
          for (int plane = 0; matched && plane < plan_.planes.count; ++plane) {
            inverse_depth.fill(static_cast<float>(planes_.inverse_depth(plane)));
            mark(tile, y, Interpolation::kLinear);
          }
        }
      }
    });
  }

  const ViewRequest& request_;
  const VirtualCamera& view_;
  const PlaneSweepPlan& plan_;
  const SweepPlanes planes_;  // relative to the farthest plane
  tbb::enumerable_thread_specific<CostScratch> scratch_;
  FieldSources sources_;
  std::vector<Matching> matching_;  // per camera of the rig
};

}  // namespace

RenderedView render(const ViewRequest& request) {
  const auto start = RenderClock::now();
  const std::optional<PlaneSweepPlan> made = plan(request);
  if (!made) return transparent_view(request);
  return Frame(request, *made).render(start);
}

}  // namespace raystage::render::plane_sweep
