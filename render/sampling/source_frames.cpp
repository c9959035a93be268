// SPDX-License-Identifier: Apache-2.0
#include "render/sampling/source_frames.h"

#include <algorithm>
#include <atomic>

#include "base/parallel.h"
#include "render/sampling/depth_sampling.h"

namespace raystage::render {
SourceFrames::SourceFrames(const LightFieldFrame& instant, const PlaneProjection& projection,
                           bool count_needed)
    : instant_(instant),
      projection_(projection),
      count_needed_(count_needed),
      sources_(instant.rig->cameras.size()) {}

void SourceFrames::open(const std::vector<int>& cameras) {
  opened_ = cameras;
  raystage::parallel_for(std::size_t{0}, opened_.size(), [&](std::size_t i) {
    const int index = opened_[i], frame = instant_.frame_of_camera[index];
    Source& source = sources_[index];
    const rig::Rig::Camera& camera = instant_.rig->cameras[index];
    source.view = make_source_view(camera.model, projection_.ideal_from_pixel(camera.pose));
    if (!count_needed_ && instant_.cache->is_fully_decoded(index, frame)) return;
    const auto layout = instant_.cache->layout(index, frame);
    source.wanted.assign(layout->mcu_count(), 0);
    set_mcu_layout(source.view, *layout, source.wanted.data());
    if (!count_needed_) return;
    source.read_pixels.assign(static_cast<std::size_t>(source.view.width) * source.view.height, 0);
    source.view.read_pixels = source.read_pixels.data();
  });
}

bool SourceFrames::are_fully_decoded() const {
  return std::ranges::all_of(opened_, [&](int camera) { return sources_[camera].wanted.empty(); });
}

void SourceFrames::decode(RenderStatistics& statistics) {
  std::atomic<std::int64_t> pixels = 0, needed = 0;
  std::atomic<int> cameras = 0;
  raystage::parallel_for(std::size_t{0}, opened_.size(), [&](std::size_t i) {
    const int index = opened_[i];
    Source& source = sources_[index];
    if (!source.wanted.empty() && std::ranges::count(source.wanted, 1) == 0) return;
    std::int64_t decoded = 0;
    source.frame = instant_.cache->fetch(index, instant_.frame_of_camera[index], source.wanted,
                                         decoded, instant_.fetch_group);
    source.view.rgba = source.frame->rgba.get();
    pixels += decoded;
    needed += std::ranges::count(source.read_pixels, 1);
    ++cameras;
  });
  statistics.pixels_decoded = pixels;
  statistics.pixels_needed = needed;
  statistics.cameras_used = cameras;
}

}  // namespace raystage::render
