// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <vector>

#include "base/image.h"

namespace raystage::simulate {

/// Returns linear light R, G, B at (u, v), each in [0, 1); v runs downwards.
using ProceduralTexture = std::function<Eigen::Vector3f(float u, float v)>;

/// A periodic texture with its mip levels. Sampling filters over the footprint of a pixel on the
/// surface (anisotropic, at most 4 taps), so that no detail finer than a pixel remains.
class Texture {
 public:
  /// Evaluates `painter` for `width` x `height` texels (powers of two).
  Texture(int width, int height, const ProceduralTexture& painter);

  /// Returns linear light. `major`, `minor`: axes of the footprint in (u, v), full lengths.
  Eigen::Vector3f sample(const Eigen::Vector2f& uv, const Eigen::Vector2f& major,
                         const Eigen::Vector2f& minor) const;

 private:
  using Texel = Eigen::Array4f;

  Texel bilinear(std::size_t level, float u, float v) const;

  std::vector<Image<Texel>> levels_;
};

}  // namespace raystage::simulate
