// SPDX-License-Identifier: Apache-2.0
// Multiplies an image by the shares that plane, box and screen clips keep, each with a linear ramp
// of its feather's width. Points come from the image's depth. Cost: pixels x clips.
#include "compose/layers/clip.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "base/parallel.h"
#include "rig/camera_model.h"

namespace raystage::compose {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;

/// Returns 0 at half a feather outside an edge to 1 at half a feather inside. `inside`: distance.
double ramp(double inside, double feather) {
  if (feather <= 0) return inside > 0 ? 1 : inside < 0 ? 0 : 0.5;
  return std::clamp(0.5 + inside / feather, 0.0, 1.0);
}

double inside(const PlaneClip& clip, const render::VirtualCamera&, const Vector2d&,
              const Vector3d& point, bool is_direction) {
  const double normal = clip.plane.head<3>().norm();
  const double along = clip.plane.head<3>().dot(point) / normal;
  if (!is_direction) return ramp(along + clip.plane[3] / normal, clip.feather);
  if (along != 0) return along > 0 ? 1 : 0;
  return ramp(clip.plane[3] / normal, clip.feather);
}

double inside(const BoxClip& clip, const render::VirtualCamera&, const Vector2d&,
              const Vector3d& point, bool is_direction) {
  if (is_direction) return 0;
  double least = 1;
  for (int axis = 0; axis < 3; ++axis) {
    const double from_wall = std::min(point[axis] - clip.min[axis], clip.max[axis] - point[axis]);
    least = std::min(least, ramp(from_wall, clip.feather));
  }
  return least;
}

double inside(const ScreenClip& clip, const render::VirtualCamera& camera, const Vector2d& pixel,
              const Vector3d&, bool) {
  const double x = pixel.x() / camera.width, y = pixel.y() / camera.height;
  const double width_by_height = static_cast<double>(camera.width) / camera.height;
  double least = 1;
  // No ramp at the image border.
  if (clip.left > 0) least = std::min(least, ramp(x - clip.left, clip.feather));
  if (clip.right < 1) least = std::min(least, ramp(clip.right - x, clip.feather));
  const double feather = clip.feather * width_by_height;
  if (clip.top > 0) least = std::min(least, ramp(y - clip.top, feather));
  if (clip.bottom < 1) least = std::min(least, ramp(clip.bottom - y, feather));
  return least;
}

void clear(LayerImage& image, std::size_t pixel) {
  image.z[pixel] = std::numeric_limits<float>::infinity();
  for (Aov& aov : image.aovs) {
    const std::size_t width = aov.channels.size();
    std::fill_n(aov.values.data() + pixel * width, width, aov.empty_value);
  }
}

}  // namespace

double kept_share(const Clip& clip, const render::VirtualCamera& camera, const Vector2d& pixel,
                  const Vector3d& point, bool is_direction) {
  const double share = std::visit(
      [&](const auto& shape) { return inside(shape, camera, pixel, point, is_direction); },
      clip.shape);
  return clip.inverted ? 1 - share : share;
}

void apply(std::span<const Clip> clips, const render::VirtualCamera& camera, LayerImage& image) {
  if (clips.empty()) return;
  parallel_for(tbb::blocked_range<int>(0, image.height), [&](const tbb::blocked_range<int>& rows) {
    for (int y = rows.begin(); y < rows.end(); ++y) {
      for (int x = 0; x < image.width; ++x) {
        const std::size_t pixel = static_cast<std::size_t>(y) * image.width + x;
        const Vector2d at(x + 0.5, y + 0.5);
        const double z = static_cast<double>(image.z[pixel]);
        const bool is_direction = !std::isfinite(z);
        const Vector3d point = is_direction ? render::pixel_ray(camera, at.x(), at.y()).direction
                                            : render::point_at_depth(camera, at.x(), at.y(), z);
        double share = 1;
        for (const Clip& clip : clips) share *= kept_share(clip, camera, at, point, is_direction);
        if (share >= 1) continue;
        float* rgba = image.rgba.data() + 4 * pixel;
        for (int c = 0; c < 4; ++c) rgba[c] *= static_cast<float>(share);
        if (share <= 0) clear(image, pixel);
      }
    }
  });
}

bool keeps_any_pixel(std::span<const Clip> clips) {
  return std::ranges::none_of(clips, [](const Clip& clip) {
    const auto* screen = std::get_if<ScreenClip>(&clip.shape);
    if (screen == nullptr) return false;
    const bool empty = screen->left >= screen->right || screen->top >= screen->bottom ||
                       screen->right <= 0 || screen->left >= 1 || screen->bottom <= 0 ||
                       screen->top >= 1;
    const bool all =
        screen->left <= 0 && screen->right >= 1 && screen->top <= 0 && screen->bottom >= 1;
    return clip.inverted ? all : empty;
  });
}

}  // namespace raystage::compose
