// SPDX-License-Identifier: Apache-2.0
#include "render/lumigraph/camera_frames.h"

#include <algorithm>
#include <atomic>

#include "base/parallel.h"
#include "render/sampling/depth_sampling.h"

namespace raystage::render {

CameraFrames::CameraFrames(const LightFieldFrame& instant, bool count_needed)
    : instant_(instant),
      count_needed_(count_needed),
      used_(instant.rig->cameras.size()),
      looked_through_(used_.size()),
      layouts_(used_.size()),
      wanted_(used_.size()),
      read_pixels_(used_.size()),
      frames_(used_.size()) {}

void CameraFrames::open(std::vector<bool> used) {
  used_ = std::move(used);
  raystage::parallel_for(std::size_t{0}, used_.size(), [&](std::size_t i) {
    wanted_[i].clear();
    frames_[i].reset();
    if (!used_[i] || layouts_[i]) return;
    layouts_[i] = instant_.cache->layout(static_cast<int>(i), instant_.frame_of_camera[i]);
  });
}

bool CameraFrames::are_fully_decoded() const {
  if (count_needed_) return false;
  for (std::size_t i = 0; i < used_.size(); ++i) {
    if (used_[i] &&
        !instant_.cache->is_fully_decoded(static_cast<int>(i), instant_.frame_of_camera[i])) {
      return false;
    }
  }
  return true;
}

void CameraFrames::set_mcu_layout(int camera, SourceView& lens) {
  const auto i = static_cast<std::size_t>(camera);
  if (!used_[i]) return;
  wanted_[i].assign(layouts_[i]->mcu_count(), 0);
  render::set_mcu_layout(lens, *layouts_[i], wanted_[i].data());
  if (!count_needed_) return;
  read_pixels_[i].resize(static_cast<std::size_t>(lens.width) * lens.height, 0);
  lens.read_pixels = read_pixels_[i].data();
}

void CameraFrames::decode(RenderStatistics& statistics) {
  std::atomic<std::int64_t> decoded = 0;
  raystage::parallel_for(std::size_t{0}, used_.size(), [&](std::size_t i) {
    const store::McuMask& mcus = wanted_[i];
    const bool none = !mcus.empty() && std::find(mcus.begin(), mcus.end(), 1) == mcus.end();
    if (!used_[i] || none) return;
    std::int64_t pixels = 0;
    frames_[i] = instant_.cache->fetch(static_cast<int>(i), instant_.frame_of_camera[i], mcus,
                                       pixels, instant_.fetch_group);
    decoded += pixels;
    looked_through_[i] = 1;
  });
  statistics.pixels_decoded += decoded;
  statistics.pixels_needed = 0;
  for (const auto& read : read_pixels_) statistics.pixels_needed += std::ranges::count(read, 1);
  statistics.cameras_used = static_cast<int>(std::ranges::count(looked_through_, 1));
}

}  // namespace raystage::render
