// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <span>
#include <vector>

#include "compose/layers/layer_image.h"

namespace raystage {

/// Width of the seam, degrees, in which a ray passes from one take to the next: half of it on
/// either side, so that what the takes see differently does not jump.
inline constexpr double kSeamDegrees = 4;

/// Which of the takes around a volume answers a ray (thesis, "Effects": an immersive environment
/// from slabs around a box): the one that faces where the ray goes, as of a box's faces; where that
/// one saw nothing, the next. `facing`: unit, world, the takes' mean viewing directions; at least
/// one, and it must live on. Made once for many rays, asked for one after the other.
class RayHolders {
 public:
  explicit RayHolders(std::span<const Eigen::Vector3d> facing);

  /// `direction`: of the ray, world, any length above 0.
  void find(const Eigen::Vector3d& direction);
  /// Of each take, for the ray found last: 1 for the one that faces it, less within the seam; they
  /// sum to 1.
  std::span<const float> shares() const { return shares_; }

  /// What the ray shows: premultiplied, as is `seen`, of each take.
  std::array<float, 4> blend(std::span<const std::array<float, 4>> seen) const;
  /// The take that shows most of it.
  std::size_t main(std::span<const std::array<float, 4>> seen) const;

 private:
  std::span<const Eigen::Vector3d> facing_;
  std::vector<double> degrees_;       ///< between the ray and what each take faces
  std::vector<std::size_t> nearest_;  ///< takes by that
  std::vector<float> shares_;
};

/// Which takes answer any pixel of the camera.
std::vector<bool> holders_of(std::span<const Eigen::Vector3d> facing, const VirtualCamera& camera);

/// The camera's picture, from the takes' pictures (null: one that need not be asked). Depth and
/// AOVs of a pixel are those of the take that shows most of it; ids and statistics are left out.
LayerImage blend_volume(std::span<const LayerImage* const> takes,
                        std::span<const Eigen::Vector3d> facing, const VirtualCamera& camera);

}  // namespace raystage
