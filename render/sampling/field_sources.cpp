// SPDX-License-Identifier: Apache-2.0
// Reads the parts of the source frames that a view blended by a BlendingField needs. Per camera and
// tile, marks the MCUs that the tile's pixels may read within the tile's range of inverse depths
// (depth_planning.cpp), then decodes them. Input: blending field, range of inverse depths (1/m) per
// tile. Cost: O(cameras x tiles), and decoding, in parallel over cameras.
#include "render/sampling/field_sources.h"

#include <algorithm>
#include <atomic>
#include <functional>

#include "base/parallel.h"
#include "render/sampling/depth_planning.h"

namespace raystage::render {

FieldSources::FieldSources(const VirtualCamera& view, const LightFieldFrame& instant,
                           const BlendingField& field, std::span<const InverseDepthRange> depths,
                           double reference, Interpolation interpolation)
    : instant_(instant), sources_(instant.rig->cameras.size()) {
  for (const BlendingField::Tile& tile : field.tiles()) {
    for (const BlendingField::TileCamera& camera : tile.cameras) {
      sources_[camera.camera].used = instant.is_local(camera.camera);
    }
  }
  raystage::parallel_for(std::size_t{0}, sources_.size(), [&](std::size_t i) {
    Source& opened = sources_[i];
    if (!opened.used) return;
    const int camera = static_cast<int>(i);
    opened.source = depth_source(view, instant.rig->cameras[i], reference);
    const auto layout = instant.cache->layout(camera, instant.frame_of_camera[i]);
    opened.wanted.assign(layout->mcu_count(), 0);
    set_mcu_layout(opened.source.camera, *layout, opened.wanted.data());
    for (std::size_t t = 0; t < depths.size(); ++t) {
      const BlendingField::Tile& tile = field.tiles()[t];
      if (find_camera(tile, camera) == nullptr) continue;
      mark_block(
          opened.source,
          {tile.left, tile.right, tile.top, tile.bottom, depths[t].farthest, depths[t].nearest},
          interpolation);
    }
  });
}

void FieldSources::decode(RenderStatistics& statistics) {
  std::atomic<std::int64_t> pixels = 0;
  std::atomic<int> cameras = 0;
  const std::vector<std::vector<std::size_t>> groups = sources_by_frame();
  raystage::parallel_for(std::size_t{0}, groups.size(), [&](std::size_t group) {
    store::McuMask wanted;  // of all facets at once: a second fetch would decode the whole frame
    for (const std::size_t i : groups[group]) {
      const store::McuMask& more = sources_[i].wanted;
      wanted.resize(std::max(wanted.size(), more.size()));
      std::ranges::transform(more, wanted, wanted.begin(), std::bit_or<>());
    }
    if (std::ranges::find(wanted, 1) == wanted.end()) return;
    const std::size_t first = groups[group].front();
    std::int64_t decoded = 0;
    const auto frame = instant_.cache->fetch(static_cast<int>(first),
                                             instant_.frame_of_camera[first], wanted, decoded);
    for (const std::size_t i : groups[group]) {
      Source& s = sources_[i];
      if (std::ranges::find(s.wanted, 1) == s.wanted.end()) continue;
      s.frame = frame;
      s.source.camera.rgba = frame->rgba.get();
    }
    pixels += decoded;
    ++cameras;
  });
  statistics.pixels_decoded = pixels;
  statistics.cameras_used = cameras;
}

std::int64_t FieldSources::count_marked_pixels(
    const std::function<void(int camera, const DepthSource& source)>& mark) const {
  std::atomic<std::int64_t> count = 0;
  const std::vector<std::vector<std::size_t>> groups = sources_by_frame();
  raystage::parallel_for(std::size_t{0}, groups.size(), [&](std::size_t group) {
    std::vector<std::uint8_t> read;
    for (const std::size_t i : groups[group]) {
      const Source& s = sources_[i];
      if (!s.frame) continue;
      read.resize(static_cast<std::size_t>(s.frame->width) * s.frame->height);
      DepthSource marking = s.source;
      marking.camera.wanted_mcus = nullptr;
      marking.camera.read_pixels = read.data();
      mark(static_cast<int>(i), marking);
    }
    count += std::count(read.begin(), read.end(), 1);
  });
  return count;
}

std::vector<std::vector<std::size_t>> FieldSources::sources_by_frame() const {
  const std::vector<int>& of_take = instant_.camera_of_take;
  std::vector<std::vector<std::size_t>> groups;
  for (std::size_t i = 0; i < sources_.size(); ++i) {
    if (!sources_[i].used) continue;
    const bool is_facet =
        !of_take.empty() && !groups.empty() && of_take[i] == of_take[groups.back().front()];
    if (!is_facet) groups.emplace_back();
    groups.back().push_back(i);
  }
  return groups;
}

const BlendingField::TileCamera* find_camera(const BlendingField::Tile& tile, int camera) {
  const auto found =
      std::ranges::lower_bound(tile.cameras, camera, {}, &BlendingField::TileCamera::camera);
  return found != tile.cameras.end() && found->camera == camera ? &*found : nullptr;
}

}  // namespace raystage::render
