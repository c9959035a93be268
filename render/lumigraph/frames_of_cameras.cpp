// SPDX-License-Identifier: Apache-2.0
#include "render/lumigraph/frames_of_cameras.h"

#include <algorithm>
#include <atomic>

#include "render/sampling/depth_sampling.h"
#include "schemas/parallel.h"

namespace raystage {
namespace {

void join_into(const std::vector<std::uint8_t>& part, std::vector<std::uint8_t>& whole) {
  if (whole.size() < part.size()) whole.resize(part.size());
  for (std::size_t i = 0; i < part.size(); ++i) whole[i] |= part[i];
}

}  // namespace

FramesOfCameras::FramesOfCameras(const Instant& instant, bool count_needed)
    : instant_(instant),
      count_needed_(count_needed),
      used_(instant.rig->cameras.size()),
      layouts_(used_.size()),
      wanted_{std::vector<McuMask>(used_.size()),
              std::vector<std::vector<std::uint8_t>>(used_.size())},
      frames_(used_.size()) {}

void FramesOfCameras::open(std::vector<bool> used) {
  used_ = std::move(used);
  raystage::parallel_for(std::size_t{0}, used_.size(), [&](std::size_t i) {
    if (!used_[i]) return;
    layouts_[i] = instant_.cache->layout(static_cast<int>(i), instant_.frame_of_camera[i]);
  });
}

bool FramesOfCameras::are_whole() const {
  if (count_needed_) return false;
  for (std::size_t i = 0; i < used_.size(); ++i) {
    if (used_[i] &&
        !instant_.cache->holds_whole(static_cast<int>(i), instant_.frame_of_camera[i])) {
      return false;
    }
  }
  return true;
}

bool FramesOfCameras::plan_into(int camera, Masks& masks, SourceView& lens) const {
  const auto i = static_cast<std::size_t>(camera);
  if (!used_[i]) return false;
  McuMask& mcus = masks.mcus[i];
  if (mcus.empty()) mcus.assign(static_cast<std::size_t>(layouts_[i]->mcu_count()), 0);
  raystage::plan_into(lens, *layouts_[i], mcus.data());
  if (!count_needed_) return true;
  masks.pixels.resize(used_.size());
  if (masks.pixels[i].empty()) {
    masks.pixels[i].assign(
        static_cast<std::size_t>(lens.width) * static_cast<std::size_t>(lens.height), 0);
  }
  lens.read_pixels = masks.pixels[i].data();
  return true;
}

void FramesOfCameras::join(const Masks& masks) {
  const std::scoped_lock lock(joining_);
  planned_ = true;
  for (std::size_t i = 0; i < used_.size(); ++i) {
    join_into(masks.mcus[i], wanted_.mcus[i]);
    if (!masks.pixels.empty()) join_into(masks.pixels[i], wanted_.pixels[i]);
  }
}

void FramesOfCameras::decode(RenderStatistics& statistics) {
  std::atomic<std::int64_t> decoded = 0, needed = 0;
  std::atomic<int> cameras = 0;
  raystage::parallel_for(std::size_t{0}, used_.size(), [&](std::size_t i) {
    const McuMask& mcus = wanted_.mcus[i];
    if (!used_[i] || (planned_ && std::find(mcus.begin(), mcus.end(), 1) == mcus.end())) return;
    std::int64_t pixels = 0;
    frames_[i] =
        instant_.cache->fetch(static_cast<int>(i), instant_.frame_of_camera[i], mcus, pixels);
    decoded += pixels;
    needed += std::count(wanted_.pixels[i].begin(), wanted_.pixels[i].end(), 1);
    ++cameras;
  });
  statistics.pixels_decoded = decoded;
  statistics.pixels_needed = needed;
  statistics.cameras_used = cameras;
}

}  // namespace raystage
