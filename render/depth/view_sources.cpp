// SPDX-License-Identifier: Apache-2.0
// Samples the cameras of a view's blending field for runs of pixels, with weights and visibility
// (blend_kernels.cpp). The pixels that are read follow from the range of depths in each tile
// (field_sources.cpp). Cost: O(pixels x cameras of a tile).
#include "render/depth/view_sources.h"

#include <algorithm>
#include <limits>

#include "base/parallel.h"
#include "render/depth/blend_kernels.h"

namespace raystage::render::depth {
namespace {

using Tile = BlendingField::Tile;
static_assert(BlendingField::kTile <= kMaxRunPixels);

/// Returns the range of the view's depths in each tile, with those of the pixels around it: pixels
/// at edges show the depths of their neighbours.
std::vector<InverseDepthRange> ranges_of(const DepthViewPlan& plan) {
  const std::vector<Tile>& tiles = plan.field.tiles();
  const InverseDepthMap& depths = plan.view_depths;
  std::vector<InverseDepthRange> ranges(tiles.size(), {std::numeric_limits<double>::infinity(), 0});
  raystage::parallel_for(std::size_t{0}, tiles.size(), [&](std::size_t i) {
    for (int y = std::max(0, tiles[i].top - 1); y < std::min(depths.height, tiles[i].bottom + 1);
         ++y) {
      for (int x = std::max(0, tiles[i].left - 1); x < std::min(depths.width, tiles[i].right + 1);
           ++x) {
        const double depth{depths.at(x, y)};
        ranges[i].farthest = std::min(ranges[i].farthest, depth);
        ranges[i].nearest = std::max(ranges[i].nearest, depth);
      }
    }
  });
  return ranges;
}

VisibilityRun visibility_run(const ViewSources& sources, const DepthViewPlan& plan, int camera,
                             const PixelRun& pixels, std::span<float> visible) {
  return {pixels.x,
          pixels.y,
          sources.transfer(camera),
          &plan.depths->maps[camera],
          &plan.depths->block_nearest[camera],
          pixels.inverse_depth,
          visibility_tolerance(plan),
          visibility_border(plan),
          visible};
}

}  // namespace

ViewSources::ViewSources(const ViewRequest& request, const DepthViewPlan& plan)
    : FieldSources(request.view, request.instant, plan.field, ranges_of(plan), 0,
                   plan.settings.interpolation),
      transfers_(size()) {
  for (std::size_t i = 0; i < size(); ++i) {
    if ((*this)[i].used) transfers_[i] = pixel_transfer(plan.depths->pinholes[i], request.view);
  }
}

void sample_camera(const ViewSources& sources, const DepthViewPlan& plan, const Tile& tile,
                   const BlendingField::TileCamera& camera, const PixelRun& pixels,
                   const CameraRun& run) {
  constexpr std::array<float, kMaxRunPixels> kAll = [] {
    std::array<float, kMaxRunPixels> ones{};
    ones.fill(1);
    return ones;
  }();
  const std::size_t n = pixels.inverse_depth.size();
  const auto first = static_cast<std::size_t>(pixels.x - tile.left);
  std::array<float, kMaxRunPixels> of_row;
  BlendingField::weights(tile, camera, pixels.y, {of_row.data(), first + n});
  std::copy_n(of_row.data() + first, n, run.weights);
  std::fill_n(run.samples, 4 * n, 0.0F);
  add_samples_at_depth(sources[camera.camera].source, pixels.x, pixels.y, pixels.inverse_depth,
                       {kAll.data(), n}, plan.settings.interpolation, {run.samples, 4 * n});
  compute_visibility(visibility_run(sources, plan, camera.camera, pixels, {run.visible, n}));
}

void weigh_front_surfaces(const ViewSources& sources, const DepthViewPlan& plan, int camera,
                          const PixelRun& pixels, const SurfaceRun& surfaces, const CameraRun& run,
                          const SeenByFrame& seen, std::span<FrontShare> shares) {
  constexpr float kFull = 65535;
  const auto begin = static_cast<std::size_t>(surfaces.begin),
             count = static_cast<std::size_t>(surfaces.end - surfaces.begin);
  const PixelRun part{pixels.x + surfaces.begin, pixels.y,
                      pixels.inverse_depth.subspan(begin, count)};
  std::array<float, kMaxRunPixels> at_surface;
  compute_surface_share(visibility_run(sources, plan, camera, part, {}),
                        {at_surface.data(), count});
  for (std::size_t i = 0; i < count; ++i) {
    const std::size_t x = begin + i;
    if (!surfaces.is_pair[x]) continue;
    const float weight = run.weights[x] * seen.values[seen.step * x] / kFull;
    shares[x].visible += weight * run.visible[x];
    shares[x].at += weight * at_surface[i];
    run.visible[x] = at_surface[i];
  }
}

}  // namespace raystage::render::depth
