// SPDX-License-Identifier: Apache-2.0
// Resamples a picture for another lens: the ray through each pixel's centre, projected by the
// camera, then bilinear interpolation. Cost: a projection and its inverse per pixel.
#include "exports/resample_lens.h"

#include <algorithm>
#include <cmath>

#include "base/parallel.h"

namespace raystage::exports {
namespace {

std::uint8_t interpolated(const store::RgbImage& picture, double x, double y, int channel) {
  const double left = std::floor(x), top = std::floor(y);
  const double u = x - left, v = y - top;
  const int i = static_cast<int>(left), j = static_cast<int>(top);
  const double above =
      (1 - u) * picture.clamped(i, j, channel) + u * picture.clamped(i + 1, j, channel);
  const double below =
      (1 - u) * picture.clamped(i, j + 1, channel) + u * picture.clamped(i + 1, j + 1, channel);
  return static_cast<std::uint8_t>(std::lround((1 - v) * above + v * below));
}

}  // namespace

store::RgbImage resample_lens(const store::RgbImage& picture, const rig::CameraModel& from,
                              const rig::CameraModel& to, const Eigen::Matrix3d& from_to) {
  store::RgbImage result(to.width(), to.height());
  constexpr double kCentre = 0.5;  // of a pixel
  parallel_for(0, result.height, [&](int y) {
    for (int x = 0; x < result.width; ++x) {
      const auto ray = to.unproject({x + kCentre, y + kCentre});
      if (!ray) continue;
      const auto pixel = from.project(from_to * *ray);
      if (!pixel || !from.contains(*pixel)) continue;
      for (int c = 0; c < 3; ++c) {
        result.at(x, y, c) = interpolated(picture, pixel->x() - kCentre, pixel->y() - kCentre, c);
      }
    }
  });
  return result;
}

}  // namespace raystage::exports
