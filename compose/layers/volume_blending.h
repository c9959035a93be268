// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include "compose/layers/layer_image.h"

namespace raystage::compose {

/// Width of the transition from one take to the next, degrees, half of it on each side.
inline constexpr double kBlendWidthDegrees = 4;

/// Selects the takes around a volume that answer a ray (thesis 7, immersive environment from slabs
/// around a box). It is the take whose viewing direction is nearest to the ray, or, if that saw
/// nothing, the next one. `view_directions`: mean viewing directions of the takes, unit vectors,
/// world; at least one; a reference is kept. One object serves many rays in turn.
class VolumeBlender {
 public:
  explicit VolumeBlender(std::span<const Eigen::Vector3d> view_directions);

  /// Selects the takes for a ray. `direction`: world, any length above 0.
  void find(const Eigen::Vector3d& direction);
  /// Returns the takes' weights for the ray: 1 for the nearest, less in transitions, of sum 1.
  std::span<const float> weights() const { return weights_; }

  /// Returns the colour of the ray from that of each take, all premultiplied.
  std::array<float, 4> blend(std::span<const std::array<float, 4>> seen) const;
  /// Returns the take with the largest contribution.
  std::size_t dominant_take(std::span<const std::array<float, 4>> seen) const;

 private:
  std::span<const Eigen::Vector3d> view_directions_;
  std::vector<double> degrees_;       ///< between the ray and each take's direction
  std::vector<std::size_t> nearest_;  ///< takes, nearest first
  std::vector<float> weights_;
};

/// Returns, for each take, whether it answers any pixel of the camera.
std::vector<bool> takes_in_view(std::span<const Eigen::Vector3d> view_directions,
                                const render::VirtualCamera& camera);

/// Returns the image of the camera from those of the takes (null: not needed). Depth and AOVs of a
/// pixel are those of the take with the largest contribution; ids and statistics are omitted.
LayerImage blend_volume(std::span<const LayerImage* const> takes,
                        std::span<const Eigen::Vector3d> view_directions,
                        const render::VirtualCamera& camera);

}  // namespace raystage::compose
