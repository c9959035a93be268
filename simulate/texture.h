// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

namespace raystage {

/// Linear light R, G, B at (u, v), each in [0, 1); v runs down the picture.
using ProceduralTexture = std::function<Eigen::Vector3f(float u, float v)>;

/// A picture with its pyramid of halved sizes, repeated over the plane. Sampling filters over the
/// footprint that a pixel has on the surface, so that nothing finer than a pixel remains.
class Texture {
 public:
  /// Paints `width` x `height` texels (powers of two).
  Texture(int width, int height, const ProceduralTexture& painter);

  /// `major`, `minor`: the axes of the pixel's footprint in (u, v), full lengths.
  Eigen::Vector3f sample(const Eigen::Vector2f& uv, const Eigen::Vector2f& major,
                         const Eigen::Vector2f& minor) const;

 private:
  using Texel = Eigen::Array4f;
  struct Level {
    int width = 0, height = 0;
    std::vector<Texel, Eigen::aligned_allocator<Texel>> texels;
  };

  Texel bilinear(std::size_t level, float u, float v) const;

  std::vector<Level> levels_;
};

}  // namespace raystage
