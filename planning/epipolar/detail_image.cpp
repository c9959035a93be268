// SPDX-License-Identifier: Apache-2.0
#include "planning/epipolar/detail_image.h"

#include <algorithm>
#include <cmath>
#include <limits>
#include <vector>

namespace raystage::planning {
namespace {

constexpr float kUnknown = std::numeric_limits<float>::quiet_NaN();
constexpr int kDetailRadius = 4;  // pixels around which the mean is removed

/// Returns the camera with pixels that are `factor` times as large.
render::VirtualCamera reduced(render::VirtualCamera camera, int factor) {
  camera.width /= factor;
  camera.height /= factor;
  camera.intrinsics.fx /= factor;
  camera.intrinsics.fy /= factor;
  camera.intrinsics.cx /= factor;
  camera.intrinsics.cy /= factor;
  return camera;
}

/// Returns the mean of a block of pixels, NaN where one is unknown.
float block_mean(std::span<const std::uint8_t> luma, int width, int x, int y, int factor) {
  int sum = 0;
  for (int row = y * factor; row < (y + 1) * factor; ++row) {
    for (int column = x * factor; column < (x + 1) * factor; ++column) {
      const std::uint8_t code = luma[static_cast<std::size_t>(row) * width + column];
      if (code == 0) return kUnknown;
      sum += code;
    }
  }
  return static_cast<float>(sum) / static_cast<float>(factor * factor);
}

/// Replaces the `count` values that are `stride` apart by their running means.
void filter_line(float* values, int count, std::ptrdiff_t stride, int radius,
                 std::vector<float>& line) {
  line.resize(static_cast<std::size_t>(count));
  for (int i = 0; i < count; ++i) line[static_cast<std::size_t>(i)] = values[i * stride];
  double sum = 0;
  int inside = 0;
  for (int i = -radius; i < count; ++i) {
    const int enters = i + radius, leaves = i - radius - 1;
    if (enters < count)
      sum += static_cast<double>(line[static_cast<std::size_t>(enters)]), ++inside;
    if (leaves >= 0) sum -= static_cast<double>(line[static_cast<std::size_t>(leaves)]), --inside;
    if (i >= 0) values[i * stride] = static_cast<float>(sum / inside);
  }
}

}  // namespace

void box_filter(Image<float>& image, int radius) {
  std::vector<float> line;
  for (int y = 0; y < image.height; ++y) {
    filter_line(image.row(y).data(), image.width, 1, radius, line);
  }
  for (int x = 0; x < image.width; ++x) {
    filter_line(image.values.data() + x, image.height, image.width, radius, line);
  }
}

float DetailImage::sample(float x, float y) const {
  const float left = x - 0.5F, top = y - 0.5F;
  if (!(left >= 0 && top >= 0 && left < static_cast<float>(detail.width - 1) &&
        top < static_cast<float>(detail.height - 1))) {
    return kUnknown;
  }
  const int column = static_cast<int>(left), row = static_cast<int>(top);
  const float u = left - static_cast<float>(column), v = top - static_cast<float>(row);
  const float* above = detail.values.data() + detail.offset(column, row);
  const float* below = above + detail.width;
  return (1 - v) * ((1 - u) * above[0] + u * above[1]) + v * ((1 - u) * below[0] + u * below[1]);
}

DetailImage make_detail_image(const render::VirtualCamera& pinhole,
                              std::span<const std::uint8_t> luma, int factor) {
  DetailImage made{reduced(pinhole, factor), {}};
  made.detail = Image<float>(made.camera.width, made.camera.height);
  Image<float> known = made.detail, mean = made.detail;
  for (int y = 0; y < known.height; ++y) {
    for (int x = 0; x < known.width; ++x) {
      const float value = block_mean(luma, pinhole.width, x, y, factor);
      made.detail.at(x, y) = value;
      known.at(x, y) = std::isnan(value) ? 0.0F : 1.0F;
      mean.at(x, y) = std::isnan(value) ? 0.0F : value;
    }
  }
  box_filter(mean, kDetailRadius);
  box_filter(known, kDetailRadius);
  for (std::size_t i = 0; i < mean.values.size(); ++i) {
    made.detail.values[i] -= mean.values[i] / known.values[i];  // NaN stays NaN
  }
  return made;
}

}  // namespace raystage::planning
