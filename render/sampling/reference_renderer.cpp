// SPDX-License-Identifier: Apache-2.0
// Common parts of the per-ray references: decodes all frames whole, computes the ray of each pixel
// with CameraModel in double, samples frames bilinearly and stores pixels with their statistics.
// Output: R, G, B, A, coverage, z in metres. Cost: all frames are decoded; one call of the
// reference's formula per pixel.
#include "render/sampling/reference_renderer.h"

#include <algorithm>
#include <atomic>
#include <cmath>
#include <optional>

#include "base/parallel.h"
#include "render/sampling/source_view.h"

namespace raystage::render {

using Eigen::Vector2d;
using Eigen::Vector3d;

namespace {

std::size_t pixel_index(int x, int y, int width) { return static_cast<std::size_t>(y) * width + x; }

}  // namespace

ReferenceFrames::ReferenceFrames(const LightFieldFrame& instant, bool count_needed_pixels,
                                 RenderStatistics& statistics)
    : frames_(instant.rig->cameras.size()), read_(frames_.size()) {
  const auto start = RenderClock::now();
  for (std::size_t i = 0; i < frames_.size(); ++i) {
    const int camera = static_cast<int>(i);
    if (!instant.is_present(camera)) continue;
    present_.push_back(camera);
    frames_[i] =
        instant.cache->fetch(camera, instant.frame_of_camera[i], {}, statistics.pixels_decoded);
    ++statistics.cameras_used;
    if (!count_needed_pixels) continue;
    read_[i].resize(static_cast<std::size_t>(frames_[i]->width) * frames_[i]->height);
  }
  statistics.decode_ms = milliseconds(RenderClock::now() - start);
}

FrameSample ReferenceFrames::sample(std::size_t camera, const Vector2d& pixel) {
  const store::DecodedFrame& frame = *frames_[camera];
  std::vector<std::uint8_t>& read = read_[camera];
  const double left = std::clamp(pixel.x() - 0.5, 0.0, frame.width - 1.0);
  const double top = std::clamp(pixel.y() - 0.5, 0.0, frame.height - 1.0);
  const int x0 = static_cast<int>(left), y0 = static_cast<int>(top);
  const int x1 = std::min(x0 + 1, frame.width - 1), y1 = std::min(y0 + 1, frame.height - 1);
  const double fx = left - x0, fy = top - y0;
  const auto mark = [&](int x, int y, double weight) {
    if (read.empty() || weight == 0) return;
    // Parallel rows may set the same byte.
    std::atomic_ref(read[pixel_index(x, y, frame.width)]).store(1, std::memory_order_relaxed);
  };
  mark(x0, y0, (1 - fy) * (1 - fx));
  mark(x1, y0, (1 - fy) * fx);
  mark(x0, y1, fy * (1 - fx));
  mark(x1, y1, fy * fx);
  const auto code = [&](int x, int y, std::size_t c) {
    return frame.rgba[pixel_index(x, y, frame.width) * 4 + c] / 65535.0;
  };
  const auto interpolated = [&](std::size_t c) {
    return (1 - fy) * ((1 - fx) * code(x0, y0, c) + fx * code(x1, y0, c)) +
           fy * ((1 - fx) * code(x0, y1, c) + fx * code(x1, y1, c));
  };
  return {{interpolated(0), interpolated(1), interpolated(2)}, interpolated(3)};
}

std::int64_t ReferenceFrames::pixels_needed() const {
  std::int64_t needed = 0;
  for (const auto& pixels : read_) needed += std::ranges::count(pixels, 1);
  return needed;
}

std::array<float, 4> premultiplied_light(const std::array<double, 3>& color, double alpha,
                                         const store::FrameCache& cache) {
  std::array<float, 4> rgba{};
  for (std::size_t c = 0; c < 3; ++c) {
    const double linear = store::part_from_value(cache.blend_space(), color[c]);
    rgba[c] = static_cast<float>(linear * cache.full_scale() * alpha);
  }
  rgba[3] = static_cast<float>(alpha);
  return rgba;
}

ReferenceRenderer::ReferenceRenderer(const ViewRequest& request)
    : request_(request), frames_(request.instant, request.count_needed_pixels, statistics_) {}

RenderedView ReferenceRenderer::render(const ReconstructRay& reconstruct) const {
  const auto start = RenderClock::now();
  const VirtualCamera& view = request_.view;
  const schemas::Intrinsics& k = view.intrinsics;
  const rig::CameraModel model({"view", view.width, view.height, k, {}, {}, {}});
  RenderedView image = empty_view(view);
  if (request_.measure_coverage) clear_coverage_measures(image);
  std::vector<float> empty_space(image.coverage.size());
  std::atomic<bool> has_empty_space = false;
  parallel_for(0, view.height, [&](int y) {
    for (int x = 0; x < view.width; ++x) {
      const auto in_camera = model.unproject({x + 0.5, y + 0.5});
      if (!in_camera) continue;
      ReferencePixel pixel;
      reconstruct({x,
                   y,
                   view.pose.world_from_camera_rotation * *in_camera,
                   {in_camera->x() * k.fx + k.cx, -in_camera->y() * k.fy + k.cy}},
                  pixel);
      const std::size_t at = image.index(x, y);
      std::ranges::copy(pixel.rgba, &image.rgba[at * 4]);
      image.coverage[at] = pixel.coverage;
      image.z[at] = pixel.z;
      empty_space[at] = pixel.empty_space;
      if (pixel.empty_space > 0) has_empty_space = true;
      if (!request_.measure_coverage) continue;
      image.cameras[at] = pixel.cameras;
      image.nearest_ray[at] = pixel.nearest_ray;
    }
  });
  if (has_empty_space) image.empty_space.assign(empty_space.begin(), empty_space.end());
  image.statistics = statistics_;
  image.statistics.pixels_needed = frames_.pixels_needed();
  image.statistics.render_ms = milliseconds(RenderClock::now() - start);
  return image;
}

}  // namespace raystage::render
