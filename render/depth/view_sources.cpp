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

/// Returns the range of the view's depths in each tile.
std::vector<InverseDepthRange> ranges_of(const DepthViewPlan& plan) {
  const std::vector<Tile>& tiles = plan.field.tiles();
  std::vector<InverseDepthRange> ranges(tiles.size(), {std::numeric_limits<double>::infinity(), 0});
  raystage::parallel_for(std::size_t{0}, tiles.size(), [&](std::size_t i) {
    for (int y = tiles[i].top; y < tiles[i].bottom; ++y) {
      for (int x = tiles[i].left; x < tiles[i].right; ++x) {
        const double depth{plan.view_depths.at(x, y)};
        ranges[i].farthest = std::min(ranges[i].farthest, depth);
        ranges[i].nearest = std::max(ranges[i].nearest, depth);
      }
    }
  });
  return ranges;
}

}  // namespace

ViewSources::ViewSources(const ViewRequest& request, const DepthViewPlan& plan)
    : FieldSources(request.view, request.instant, plan.field, ranges_of(plan), 0,
                   plan.settings.interpolation),
      plan_(plan),
      transfers_(size()) {
  for (std::size_t i = 0; i < size(); ++i) {
    if ((*this)[i].used) transfers_[i] = pixel_transfer(plan.depths->pinholes[i], request.view);
  }
}

void sample_camera(const ViewSources& sources, const DepthViewPlan& plan, const Tile& tile,
                   const BlendingField::TileCamera& camera, int y, const CameraRun& run) {
  constexpr std::array<float, kMaxRunPixels> kAll = [] {
    std::array<float, kMaxRunPixels> ones{};
    ones.fill(1);
    return ones;
  }();
  const auto n = static_cast<std::size_t>(tile.right - tile.left);
  const std::span<const float> depths(sources.depths_at(tile.left, y), n);
  BlendingField::weights(tile, camera, y, {run.weights, n});
  std::fill_n(run.samples, 4 * n, 0.0F);
  add_samples_at_depth(sources[camera.camera].source, tile.left, y, depths, {kAll.data(), n},
                       plan.settings.interpolation, {run.samples, 4 * n});
  compute_visibility({tile.left,
                      y,
                      sources.transfer(camera.camera),
                      &plan.depths->maps[camera.camera],
                      &plan.depths->block_nearest[camera.camera],
                      depths,
                      visibility_tolerance(plan),
                      {run.visible, n}});
}

}  // namespace raystage::render::depth
