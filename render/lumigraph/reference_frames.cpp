// SPDX-License-Identifier: Apache-2.0
#include "render/lumigraph/reference_frames.h"

#include <algorithm>
#include <atomic>

#include "base/transfer_function.h"

namespace raystage {

ReferenceFrames::ReferenceFrames(const LightFieldFrame& instant, bool count_needed,
                                 RenderStatistics& statistics)
    : instant_(instant), frames_(instant.rig->cameras.size()), read_(frames_.size()) {
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    const int camera = static_cast<int>(i);
    if (!instant.is_present(camera)) continue;
    present_.push_back(camera);
    frames_[i] =
        instant.cache->fetch(camera, instant.frame_of_camera[i], {}, statistics.pixels_decoded);
    ++statistics.cameras_used;
    if (!count_needed) continue;
    read_[i].assign(
        static_cast<std::size_t>(frames_[i]->width) * static_cast<std::size_t>(frames_[i]->height),
        0);
  }
}

std::array<float, 4> ReferenceFrames::blend(const std::vector<WeightedCamera>& cameras) {
  std::array<double, 4> mean{};
  double seen = 0;
  for (const WeightedCamera& camera : cameras) {
    const DecodedFrame& frame = *frames_[static_cast<std::size_t>(camera.camera)];
    std::vector<std::uint8_t>& read = read_[static_cast<std::size_t>(camera.camera)];
    seen = std::max(seen, camera.seen);
    const double left = std::clamp(camera.pixel.x() - 0.5, 0.0, frame.width - 1.0);
    const double top = std::clamp(camera.pixel.y() - 0.5, 0.0, frame.height - 1.0);
    const int x0 = static_cast<int>(left), y0 = static_cast<int>(top);
    for (const int y : {y0, y0 + 1}) {
      for (const int x : {x0, x0 + 1}) {
        const double weight = (x == x0 ? 1 - (left - x0) : left - x0) *
                              (y == y0 ? 1 - (top - y0) : top - y0) * camera.weight;
        if (weight == 0) continue;
        const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(frame.width) +
                               static_cast<std::size_t>(x);
        for (std::size_t c = 0; c < 4; ++c) mean[c] += weight * frame.rgba[at * 4 + c] / 65535.0;
        // Rays of other threads may set the same byte.
        if (!read.empty()) std::atomic_ref(read[at]).store(1, std::memory_order_relaxed);
      }
    }
  }
  std::array<float, 4> rgba{};
  if (!(mean[3] > 0)) return rgba;
  const double alpha = seen * mean[3];
  const bool perceptual = instant_.cache->blend_space() == BlendSpace::kPerceptual;
  for (std::size_t c = 0; c < 3; ++c) {
    const double code = mean[c] / mean[3];
    const double linear = perceptual ? linear_from_srgb(code) : code;
    rgba[c] = static_cast<float>(linear * instant_.cache->full_scale() * alpha);
  }
  rgba[3] = static_cast<float>(alpha);
  return rgba;
}

std::int64_t ReferenceFrames::pixels_needed() const {
  std::int64_t needed = 0;
  for (const auto& pixels : read_) needed += std::count(pixels.begin(), pixels.end(), 1);
  return needed;
}

}  // namespace raystage
