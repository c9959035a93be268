// SPDX-License-Identifier: Apache-2.0
// Builds a periodic texture as mip levels of 2x2 box averages, in linear light, and samples it. A
// sample takes up to 4 trilinear taps along the longer axis of its footprint (anisotropic
// filtering). The mip level follows the shorter axis, or a quarter of the longer one if that is
// more. Construction evaluates the procedural texture twice per texel; a sample reads 8 texels per
// tap.
#include "simulate/texture.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>

#include "base/parallel.h"

namespace raystage::simulate {
namespace {

constexpr float kMaxTaps = 4;

// Replaces std::floor, which is a function call on baseline x86-64.
int floor_to_int(float x) {
  const int truncated = static_cast<int>(x);
  return truncated - (x < static_cast<float>(truncated) ? 1 : 0);
}

}  // namespace

Texture::Texture(int width, int height, const ProceduralTexture& painter) {
  assert(std::has_single_bit(static_cast<unsigned>(width)) &&
         std::has_single_bit(static_cast<unsigned>(height)));
  Image<Texel>& painted = levels_.emplace_back(width, height);
  raystage::parallel_for(0, height, [&](int row) {
    for (int column = 0; column < width; ++column) {
      // Two samples on the diagonal suffice: the mip levels average further.
      const auto at = [&](float x, float y) {
        return painter((static_cast<float>(column) + x) / static_cast<float>(width),
                       (static_cast<float>(row) + y) / static_cast<float>(height));
      };
      const Eigen::Vector3f mean = (at(0.25F, 0.25F) + at(0.75F, 0.75F)) / 2;
      painted.at(column, row) = Texel(mean.x(), mean.y(), mean.z(), 1);
    }
  });
  while (levels_.back().width > 1 || levels_.back().height > 1) {
    const Image<Texel>& fine = levels_.back();
    Image<Texel> coarse(std::max(1, fine.width / 2), std::max(1, fine.height / 2));
    for (int row = 0; row < coarse.height; ++row) {
      for (int column = 0; column < coarse.width; ++column) {
        const int x = 2 * column, y = 2 * row;
        coarse.at(column, row) = (fine.clamped(x, y) + fine.clamped(x + 1, y) +
                                  fine.clamped(x, y + 1) + fine.clamped(x + 1, y + 1)) /
                                 4;
      }
    }
    levels_.push_back(std::move(coarse));
  }
}

Texture::Texel Texture::bilinear(std::size_t index, float u, float v) const {
  const Image<Texel>& level = levels_[index];
  const float x = u * static_cast<float>(level.width) - 0.5F;
  const float y = v * static_cast<float>(level.height) - 0.5F;
  const int left = floor_to_int(x), top = floor_to_int(y);
  const float fx = x - static_cast<float>(left), fy = y - static_cast<float>(top);
  const int mask_x = level.width - 1, mask_y = level.height - 1;
  const int x0 = left & mask_x, x1 = (left + 1) & mask_x;
  const int y0 = top & mask_y, y1 = (top + 1) & mask_y;
  const Texel upper = level.at(x0, y0) * (1 - fx) + level.at(x1, y0) * fx;
  const Texel lower = level.at(x0, y1) * (1 - fx) + level.at(x1, y1) * fx;
  return upper * (1 - fy) + lower * fy;
}

Eigen::Vector3f Texture::sample(const Eigen::Vector2f& uv, const Eigen::Vector2f& major,
                                const Eigen::Vector2f& minor) const {
  const Eigen::Vector2f size(static_cast<float>(levels_[0].width),
                             static_cast<float>(levels_[0].height));
  float longer = major.cwiseProduct(size).norm();
  float shorter = minor.cwiseProduct(size).norm();
  Eigen::Vector2f axis = major;
  if (longer < shorter) {
    std::swap(longer, shorter);
    axis = minor;
  }
  // Bilinear interpolation filters about a texel: mip levels cover 2/3 of the footprint.
  const float width = std::max(shorter, longer / kMaxTaps) * 0.67F;
  const float finest = std::max(width, 1.0F);
  const auto last = static_cast<float>(levels_.size() - 1);
  const float level = std::min(std::log2(finest), last);
  const auto lower = static_cast<std::size_t>(level);
  const std::size_t upper = std::min(lower + 1, levels_.size() - 1);
  const float blend = level - static_cast<float>(lower);
  const int taps =
      std::clamp(static_cast<int>(longer / std::max(shorter, 1e-6F) + 0.5F), 1,
                 std::max(1, std::min(static_cast<int>(kMaxTaps), static_cast<int>(longer) + 1)));
  Texel sum = Texel::Zero();
  for (int tap = 0; tap < taps; ++tap) {
    const float shift = (static_cast<float>(tap) + 0.5F) / static_cast<float>(taps) - 0.5F;
    const float u = uv.x() + axis.x() * shift, v = uv.y() + axis.y() * shift;
    sum += bilinear(lower, u, v) * (1 - blend) + bilinear(upper, u, v) * blend;
  }
  const Texel mean = sum / static_cast<float>(taps);
  return {mean[0], mean[1], mean[2]};
}

}  // namespace raystage::simulate
