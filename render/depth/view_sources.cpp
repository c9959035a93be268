// SPDX-License-Identifier: Apache-2.0
// Determines for each camera of a view's blending field which pixels of its frame the view reads,
// by the range of depths in each tile, decodes them, and samples runs of pixels with weights and
// visibility (blend_kernels.cpp). Cost: O(tiles x cameras) to plan, O(pixels x cameras of a tile)
// to sample.
#include "render/depth/view_sources.h"

#include <algorithm>
#include <atomic>
#include <limits>

#include "base/parallel.h"
#include "render/depth/blend_kernels.h"
#include "render/sampling/depth_planning.h"

namespace raystage::depth {
namespace {

using Tile = BlendingField::Tile;
static_assert(BlendingField::kTile <= kMaxRunPixels);

bool has_camera(const Tile& tile, int camera) {
  return std::ranges::binary_search(tile.cameras, camera, {}, &BlendingField::TileCamera::camera);
}

}  // namespace

ViewSources::Range ViewSources::range_of(const Tile& tile) const {
  Range range{std::numeric_limits<float>::infinity(), 0};
  for (int y = tile.top; y < tile.bottom; ++y) {
    const auto [least, most] =
        std::minmax_element(depths_at(tile.left, y), depths_at(tile.right, y));
    range.farthest = std::min(range.farthest, *least);
    range.nearest = std::max(range.nearest, *most);
  }
  return range;
}

ViewSources::ViewSources(const ViewRequest& request, const DepthViewPlan& plan)
    : request_(request), plan_(plan), sources_(request.instant.rig->cameras.size()) {
  const BlendingField& field = plan_.field;
  std::vector<Range> ranges(static_cast<std::size_t>(field.columns() * field.rows()));
  raystage::parallel_for(0, field.rows(), [&](int row) {
    for (int column = 0; column < field.columns(); ++column) {
      ranges[static_cast<std::size_t>(row * field.columns() + column)] =
          range_of(field.tile(column, row));
    }
  });
  const LightFieldFrame& instant = request_.instant;
  for (int row = 0; row < field.rows(); ++row) {
    for (int column = 0; column < field.columns(); ++column) {
      for (const auto& camera : field.tile(column, row).cameras) {
        sources_[static_cast<std::size_t>(camera.camera)].used = instant.is_local(camera.camera);
      }
    }
  }
  raystage::parallel_for(std::size_t{0}, sources_.size(), [&](std::size_t i) {
    Source& opened = sources_[i];
    if (!opened.used) return;
    const int camera = static_cast<int>(i);
    opened.look_up = depth_source(request_.view, instant.rig->cameras[i]);
    opened.transfer = pixel_transfer(plan_.depths->pinholes[i], request_.view);
    const auto layout = instant.cache->layout(camera, instant.frame_of_camera[i]);
    opened.wanted.assign(static_cast<std::size_t>(layout->mcu_count()), 0);
    set_mcu_layout(opened.look_up.camera, *layout, opened.wanted.data());
    for (int row = 0; row < field.rows(); ++row) {
      for (int column = 0; column < field.columns(); ++column) {
        const Tile& tile = field.tile(column, row);
        if (!has_camera(tile, camera)) continue;
        const Range& range = ranges[static_cast<std::size_t>(row * field.columns() + column)];
        mark_block(opened.look_up,
                   {tile.left, tile.right, tile.top, tile.bottom, range.farthest, range.nearest},
                   plan_.settings.look_up);
      }
    }
  });
}

void ViewSources::decode(RenderStatistics& statistics) {
  std::atomic<std::int64_t> pixels = 0;
  std::atomic<int> cameras = 0;
  raystage::parallel_for(std::size_t{0}, sources_.size(), [&](std::size_t i) {
    Source& s = sources_[i];
    if (!s.used || std::ranges::find(s.wanted, 1) == s.wanted.end()) return;
    std::int64_t decoded = 0;
    s.frame = request_.instant.cache->fetch(static_cast<int>(i),
                                            request_.instant.frame_of_camera[i], s.wanted, decoded);
    s.look_up.camera.rgba = s.frame->rgba.get();
    pixels += decoded;
    ++cameras;
  });
  statistics.pixels_decoded = pixels;
  statistics.cameras_used = cameras;
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
  const ViewSources::Source& from = sources.source(camera.camera);
  BlendingField::weights(tile, camera, y, {run.weights, n});
  std::fill_n(run.samples, 4 * n, 0.0F);
  add_samples_at_depth(from.look_up, tile.left, y, depths, {kAll.data(), n}, plan.settings.look_up,
                       {run.samples, 4 * n});
  const auto index = static_cast<std::size_t>(camera.camera);
  compute_visibility({tile.left,
                      y,
                      from.transfer,
                      &plan.depths->maps[index],
                      &plan.depths->block_nearest[index],
                      depths,
                      visibility_tolerance(plan),
                      {run.visible, n}});
}

}  // namespace raystage::depth
