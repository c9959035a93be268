// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "render/common/view.h"
#include "rig/rig.h"

namespace raystage::render {

/// Returns the signed distance in metres of `point` from the plane a x + b y + c z + d = 0, with
/// (a, b, c) not 0. It is accurate to the last places also where the terms nearly cancel, as far
/// from the world's origin (compensated sum: Ogita, Rump and Oishi, Accurate Sum and Dot Product,
/// 2005). Returns 0, on the plane, where the terms cancel to less than the rounding of the given
/// numbers or to less than 1e-30 m.
double signed_plane_distance(const Eigen::Vector4d& plane, const Eigen::Vector3d& point);

/// Projects a focal plane into a virtual camera: where each pixel's ray meets the plane, and where
/// the rig's cameras see that point (thesis 4.1.2: a homography per camera).
///
/// With the plane n.X + c = 0, the eye O, h = n.O + c and the ray d, the point is O - d h / (n.d).
/// Multiplied by |n.d| and taken relative to a camera's centre C it is
///   |h| d - sign(h) (n.d) (O - C),
/// This is linear in the pixel, without a division, for planes from next to the eye to infinity.
class PlaneProjection {
 public:
  /// Projects `plane` into `view`: a x + b y + c z + d = 0 in the world, any scale; (0, 0, 0, d) is
  /// at infinity. Throws Error (bad input) where all four are 0 or one is not finite. Also throws
  /// where the plane lies further than 1e30 m from the world's origin without being at infinity.
  PlaneProjection(const VirtualCamera& view, const Eigen::Vector4d& plane);

  /// Returns the matrix that maps (x, y, 1) of the view's pixel to (X, Y, W). The camera's ideal
  /// image point is (X/W, Y/W), visible if W > 0. Pixels where depth() is not positive have no such
  /// point.
  Eigen::Matrix3d ideal_from_pixel(const rig::Pose& camera) const;

  /// Returns the slope of the plane. The planar depth along the view's axis is distance() /
  /// slope().(x, y, 1), where that is positive. The slope is 0 for a plane at infinity.
  const Eigen::Vector3d& slope() const { return slope_; }
  double distance() const { return distance_; }
  bool at_infinity() const { return at_infinity_; }
  /// Returns the planar depth of the plane at a pixel in metres. It is infinity for a plane at
  /// infinity, and 0 where the ray does not meet the plane in front of the virtual camera.
  double depth(double x, double y) const;

 private:
  Eigen::Matrix3d ray_from_pixel_;
  Eigen::Vector3d eye_, slope_;
  double distance_ = 0;
  bool at_infinity_ = false;
};

}  // namespace raystage::render
