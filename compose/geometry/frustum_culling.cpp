// SPDX-License-Identifier: Apache-2.0
// Tests the bounding sphere of a mesh against five half-spaces: the four sides of the view frustum
// and the plane through the camera. Conservative: never rejects a visible mesh. Constant cost.
#include "compose/geometry/frustum_culling.h"

#include <Eigen/Eigenvalues>
#include <Eigen/Geometry>
#include <cmath>

namespace raystage::compose {

using Eigen::Vector3d;

bool may_intersect_frustum(const MeshInstance& mesh, const render::VirtualCamera& camera) {
  if (camera.is_equirectangular) return true;
  const rig::Pose& pose = camera.pose;
  const Vector3d centre = pose.world_from_camera_rotation.transpose() *
                          (mesh.world_from_object * mesh.scene->centre() - pose.position);
  const Eigen::Matrix3d linear = mesh.world_from_object.linear();
  const Eigen::SelfAdjointEigenSolver<Eigen::Matrix3d> stretches(linear.transpose() * linear,
                                                                 Eigen::EigenvaluesOnly);
  const double stretch = std::sqrt(stretches.eigenvalues().maxCoeff());
  const double radius = 1.001 * mesh.scene->radius() * stretch;
  const schemas::Intrinsics& k = camera.intrinsics;
  // Inward normals in camera coordinates: left, right, top, bottom, forward.
  const Vector3d inwards[] = {{k.fx, 0, -k.cx},
                              {-k.fx, 0, -(camera.width - k.cx)},
                              {0, -k.fy, -k.cy},
                              {0, k.fy, -(camera.height - k.cy)},
                              {0, 0, -1}};
  for (const Vector3d& normal : inwards) {
    if (normal.dot(centre) < -radius * normal.norm()) return false;
  }
  return true;
}

}  // namespace raystage::compose
