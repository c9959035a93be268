// SPDX-License-Identifier: Apache-2.0
#include "simulate/texture.h"

#include <algorithm>
#include <bit>
#include <cassert>
#include <cmath>

#include "base/parallel.h"

namespace raystage {
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
  levels_.push_back({width, height, {}});
  Level& painted = levels_.back();
  painted.texels.resize(static_cast<std::size_t>(width) * static_cast<std::size_t>(height));
  raystage::parallel_for(0, height, [&](int row) {
    for (int column = 0; column < width; ++column) {
      // Two samples on the diagonal suffice: the mip levels average further.
      const auto at = [&](float x, float y) {
        return painter((static_cast<float>(column) + x) / static_cast<float>(width),
                       (static_cast<float>(row) + y) / static_cast<float>(height));
      };
      const Eigen::Vector3f mean = (at(0.25F, 0.25F) + at(0.75F, 0.75F)) / 2;
      painted.texels[static_cast<std::size_t>(row) * static_cast<std::size_t>(width) +
                     static_cast<std::size_t>(column)] = Texel(mean.x(), mean.y(), mean.z(), 1);
    }
  });
  while (levels_.back().width > 1 || levels_.back().height > 1) {
    const Level& fine = levels_.back();
    Level coarse{std::max(1, fine.width / 2), std::max(1, fine.height / 2), {}};
    coarse.texels.reserve(static_cast<std::size_t>(coarse.width) *
                          static_cast<std::size_t>(coarse.height));
    const auto texel = [&](int column, int row) {
      return fine.texels[static_cast<std::size_t>(std::min(row, fine.height - 1)) *
                             static_cast<std::size_t>(fine.width) +
                         static_cast<std::size_t>(std::min(column, fine.width - 1))];
    };
    for (int row = 0; row < coarse.height; ++row) {
      for (int column = 0; column < coarse.width; ++column) {
        const int x = 2 * column, y = 2 * row;
        const Texel mean =
            (texel(x, y) + texel(x + 1, y) + texel(x, y + 1) + texel(x + 1, y + 1)) / 4;
        coarse.texels.push_back(mean);
      }
    }
    levels_.push_back(std::move(coarse));
  }
}

Texture::Texel Texture::bilinear(std::size_t index, float u, float v) const {
  const Level& level = levels_[index];
  const float x = u * static_cast<float>(level.width) - 0.5F;
  const float y = v * static_cast<float>(level.height) - 0.5F;
  const int left = floor_to_int(x), top = floor_to_int(y);
  const float fx = x - static_cast<float>(left), fy = y - static_cast<float>(top);
  const int mask_x = level.width - 1, mask_y = level.height - 1;
  const auto width = static_cast<std::size_t>(level.width);
  const auto x0 = static_cast<std::size_t>(left & mask_x);
  const auto x1 = static_cast<std::size_t>((left + 1) & mask_x);
  const auto row0 = static_cast<std::size_t>(top & mask_y) * width;
  const auto row1 = static_cast<std::size_t>((top + 1) & mask_y) * width;
  const Texel upper = level.texels[row0 + x0] * (1 - fx) + level.texels[row0 + x1] * fx;
  const Texel lower = level.texels[row1 + x0] * (1 - fx) + level.texels[row1 + x1] * fx;
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

}  // namespace raystage
