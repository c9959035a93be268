// SPDX-License-Identifier: Apache-2.0
#include "render/planar/reference_sampling.h"

#include <algorithm>
#include <atomic>

#include "render/sampling/source_view.h"

namespace raystage {

using Eigen::Vector2d;
using Eigen::Vector3d;

FrameSample sample_bilinear(const DecodedFrame& frame, const Vector2d& pixel, double seen,
                            ReadPixelMask& read) {
  const double left = std::clamp(pixel.x() - 0.5, 0.0, frame.width - 1.0);
  const double top = std::clamp(pixel.y() - 0.5, 0.0, frame.height - 1.0);
  const int x0 = static_cast<int>(left), y0 = static_cast<int>(top);
  const double fx = left - x0, fy = top - y0;
  const int x1 = std::min(x0 + 1, frame.width - 1), y1 = std::min(y0 + 1, frame.height - 1);
  const auto code = [&](int x, int y, std::size_t c) {
    const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(frame.width) +
                           static_cast<std::size_t>(x);
    return frame.rgba[at * 4 + c] / 65535.0;
  };
  // Rows that run at the same time may set the same byte.
  const auto mark = [&](int x, int y, double weight) {
    if (read.empty() || weight == 0) return;
    const std::size_t at = static_cast<std::size_t>(y) * static_cast<std::size_t>(frame.width) +
                           static_cast<std::size_t>(x);
    std::atomic_ref(read[at]).store(1, std::memory_order_relaxed);
  };
  mark(x0, y0, (1 - fy) * (1 - fx));
  mark(x1, y0, (1 - fy) * fx);
  mark(x0, y1, fy * (1 - fx));
  mark(x1, y1, fy * fx);
  const auto between = [&](std::size_t c) {
    return (1 - fy) * ((1 - fx) * code(x0, y0, c) + fx * code(x1, y0, c)) +
           fy * ((1 - fx) * code(x0, y1, c) + fx * code(x1, y1, c));
  };
  FrameSample sample;
  sample.seen = seen;
  for (std::size_t c = 0; c < 3; ++c) {
    sample.rgb[c] = between(c);
  }
  sample.alpha = between(3);
  return sample;
}

double visibility(const CameraModel& model, const Vector3d& direction_in_camera, Vector2d& pixel) {
  if (direction_in_camera.z() >= 0) return 0;
  const Vector2d ideal(direction_in_camera.x() / -direction_in_camera.z(),
                       direction_in_camera.y() / direction_in_camera.z());
  const std::optional<Vector2d> projected = model.pixel_from_ideal(ideal);
  if (!projected) return 0;
  pixel = *projected;
  const double to_border =
      std::min({pixel.x(), model.width() - pixel.x(), pixel.y(), model.height() - pixel.y()});
  const double border = std::clamp(to_border * kBorderFade, 0.0, 1.0);
  const double to_fold = 1 - ideal.squaredNorm() / model.fold_radius_squared();
  const double fold = model.has_distortion() ? std::clamp(to_fold * kFoldFade, 0.0, 1.0) : 1.0;
  return border * fold;
}

}  // namespace raystage
