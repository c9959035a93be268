// SPDX-License-Identifier: Apache-2.0
// Renders a view of the method "depth" from its plan (depth_view_plan.cpp). Determines the source
// pixels, decodes them, and per pixel blends the samples of the selected cameras by weight,
// visibility and agreement (blend_kernels.cpp). Input: the inverse depth (1/m) of each pixel of the
// view. Output: premultiplied linear RGBA, coverage and planar depth z in metres. Cost: O(pixels x
// cameras of a tile). Reference: depth_reference.cpp.
#include "render/depth/depth.h"

#include <algorithm>
#include <array>
#include <limits>

#include "base/parallel.h"
#include "render/depth/blend_kernels.h"
#include "render/depth/view_sources.h"
#include "render/sampling/field_coverage.h"

namespace raystage::render::depth {
namespace {

using Tile = BlendingField::Tile;
static_assert(BlendingField::kTile <= kMaxRunPixels);

class Frame {
 public:
  Frame(const ViewRequest& request, const DepthViewPlan& plan)
      : request_(request), view_(request.view), plan_(plan), sources_(request, plan) {}

  RenderedView render(RenderClock::time_point start) {
    RenderedView image = uninitialised_view(view_);
    const auto planned = RenderClock::now();
    sources_.decode(image.statistics);
    const auto decoded = RenderClock::now();
    blend(image);
    image.notes = plan_.notes;
    image.statistics.working_bytes = plan_.work.bytes;
    image.statistics.pixels_decoded += plan_.work.pixels_decoded;
    image.statistics.plan_ms = milliseconds(planned - start);
    image.statistics.decode_ms = milliseconds(decoded - planned);
    image.statistics.render_ms = milliseconds(RenderClock::now() - decoded);
    if (request_.count_needed_pixels) image.statistics.pixels_needed = count_needed();
    if (request_.measure_coverage) measure_coverage(request_, plan_, image);
    return image;
  }

 private:
  /// Blends tile by tile, not row by row: adjacent rows read the same source pixels from the cache.
  void blend(RenderedView& image) {
    constexpr int kTiles = 4;
    const std::vector<Tile>& all = plan_.field.tiles();
    raystage::parallel_for(tbb::blocked_range<int>(0, static_cast<int>(all.size()), kTiles),
                           [&](const tbb::blocked_range<int>& tiles) {
                             Scratch scratch;
                             for (int i = tiles.begin(); i < tiles.end(); ++i) {
                               const Tile& tile = all[i];
                               for (int y = tile.top; y < tile.bottom; ++y) {
                                 blend_run(tile, y, scratch, image);
                               }
                             }
                           });
  }

  /// Samples, weights and visibility of all cameras of a run; reused from run to run.
  struct Scratch {
    std::vector<std::array<float, 4 * kMaxRunPixels>> samples;
    std::vector<std::array<float, kMaxRunPixels>> weights, visible;
    std::array<float, kMaxRunPixels> seen, seen_by_all;  // of frames with a matte
    std::vector<const float*> sample_of, share_of, visible_of;
  };

  void blend_run(const Tile& tile, int y, Scratch& scratch, RenderedView& image) {
    const auto n = static_cast<std::size_t>(tile.right - tile.left);
    const std::span<const float> depths(sources_.depths_at(tile.left, y), n);
    scratch.samples.resize(std::max(scratch.samples.size(), tile.cameras.size()));
    scratch.weights.resize(scratch.samples.size());
    scratch.visible.resize(scratch.samples.size());
    scratch.sample_of.clear();
    scratch.share_of.clear();
    scratch.visible_of.clear();
    constexpr std::array<float, kMaxRunPixels> kAll = [] {
      std::array<float, kMaxRunPixels> ones{};
      ones.fill(1);
      return ones;
    }();
    const store::FrameCache& cache = *request_.instant.cache;
    scratch.seen_by_all = {};
    for (const BlendingField::TileCamera& camera : tile.cameras) {
      const ViewSources::Source& from = sources_[camera.camera];
      if (!from.frame) continue;
      const std::size_t i = scratch.sample_of.size();
      auto& share = scratch.weights[i];
      auto& samples = scratch.samples[i];
      sample_camera(sources_, plan_, tile, camera, y,
                    {samples.data(), share.data(), scratch.visible[i].data()});
      if (cache.has_matte()) {
        scratch.seen = {};
        add_visibility_at_depth(from.source, tile.left, y, depths, {kAll.data(), n},
                                {scratch.seen.data(), n});
        for (std::size_t x = 0; x < n; ++x) {
          scratch.seen_by_all[x] += share[x] * scratch.visible[i][x] * scratch.seen[x];
        }
      }
      scratch.sample_of.push_back(samples.data());
      scratch.share_of.push_back(share.data());
      scratch.visible_of.push_back(scratch.visible[i].data());
    }
    const std::size_t at = image.index(tile.left, y);
    const std::span<float> rgba(&image.rgba[at * 4], n * 4);
    blend_reweighted({scratch.sample_of, scratch.share_of, scratch.visible_of, static_cast<int>(n),
                      static_cast<float>(plan_.settings.agreement * 257)},
                     rgba);
    const auto full_scale = static_cast<float>(cache.full_scale());
    if (cache.has_matte()) {
      finish_samples(rgba, {scratch.seen_by_all.data(), n}, cache.blend_space(), full_scale, rgba);
    } else {
      finish_samples(rgba, cache.blend_space(), full_scale, rgba);
    }
    for (std::size_t x = 0; x < n; ++x) {
      const float alpha = rgba[4 * x + 3];
      const float absent = absent_camera_weight(plan_.complete, request_.instant,
                                                tile.left + static_cast<int>(x), y);
      image.coverage[at + x] = alpha * (1 - absent);
      image.z[at + x] =
          alpha > 0 && depths[x] > 0 ? 1 / depths[x] : std::numeric_limits<float>::infinity();
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
          mark_samples_at_depth(marking, tile.left, y, {sources_.depths_at(tile.left, y), n},
                                {share.data(), n}, plan_.settings.interpolation);
        }
      }
    });
  }

  const ViewRequest& request_;
  const VirtualCamera& view_;
  const DepthViewPlan& plan_;
  ViewSources sources_;
};

}  // namespace

RenderedView render(const ViewRequest& request) {
  const auto start = RenderClock::now();
  const std::optional<DepthViewPlan> made = plan(request);
  if (!made) return transparent_view(request);
  return Frame(request, *made).render(start);
}

}  // namespace raystage::render::depth
