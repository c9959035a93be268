// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <rapidcheck.h>

#include <Eigen/Geometry>
#include <cstddef>
#include <numbers>
#include <vector>

#include "render/common/view.h"
#include "rig/rig.h"
#include "testing/render/synthetic_take.h"

/// RapidCheck generators over all extremes of docs/numerics.md. Call them only within a property.
namespace raystage::testing {

/// Returns a number in [0, 1), from the first case on (RapidCheck would start near 0).
inline double unit() {
  constexpr int kParts = 1 << 20;
  return *rc::gen::resize(rc::kNominalSize, rc::gen::inRange(0, kParts)) /
         static_cast<double>(kParts);
}
inline double between(double low, double high) { return low + (high - low) * unit(); }

inline Eigen::Vector3d direction() {
  const Eigen::Vector3d v(between(-1, 1), between(-1, 1), between(-1, 1));
  return v.norm() > 0.1 ? v.normalized() : Eigen::Vector3d::UnitY();
}
inline Eigen::Matrix3d rotation() {
  return Eigen::AngleAxisd(between(-3, 3), direction()).toRotationMatrix();
}

/// Returns the world's origin or a point 1e7 m away.
inline Eigen::Vector3d random_origin() {
  const double far = *rc::gen::element(0.0, 0.0, 1e7);
  return {far, -far, 0.3 * far};
}

/// Returns a pose with any rotation within `reach` metres of a point.
inline rig::Pose random_pose(const Eigen::Vector3d& around, double reach) {
  return {rotation(), around + reach * direction() * unit()};
}

/// Returns a plane `distance` from the point towards `ahead`; its equation has any scale.
inline Eigen::Vector4d random_plane(const Eigen::Vector3d& point, double distance,
                                    const Eigen::Vector3d& ahead) {
  const Eigen::Vector3d normal = ahead * *rc::gen::element(1e-3, 1.0, 1e5);
  Eigen::Vector4d plane;
  plane << normal, -(normal.dot(point) + distance * normal.norm());
  return plane;
}
inline Eigen::Vector4d random_plane(const Eigen::Vector3d& point, double distance) {
  return random_plane(point, distance, direction());
}

/// Returns a view of 1 to 16384 pixels per row, 0.01 to 179 degrees wide.
inline render::VirtualCamera random_view(const rig::Pose& pose) {
  const double degrees = *rc::gen::element(0.01, 1.0, 10.0, 50.0, 120.0, 179.0);
  const int width = *rc::gen::element(1, 24, 640, 16384);
  return render::virtual_camera_with_fov(width, *rc::gen::element(1, 18),
                                         degrees * std::numbers::pi / 180, pose);
}

/// Returns a rotation that looks at a target, which must differ from the eye.
inline Eigen::Matrix3d rotation_towards(const Eigen::Vector3d& eye, const Eigen::Vector3d& target) {
  return Eigen::Quaterniond::FromTwoVectors(-Eigen::Vector3d::UnitZ(), target - eye)
      .toRotationMatrix();
}

inline std::vector<int> all_cameras(const rig::Rig& rig) {
  std::vector<int> cameras(rig.cameras.size());
  for (std::size_t i = 0; i < cameras.size(); ++i) cameras[i] = static_cast<int>(i);
  return cameras;
}

/// Returns a jittered grid, a row or a single camera of any pose; spacing 1 mm to 5 m.
inline rig::Rig random_rig(int image_width = 64, int image_height = 48) {
  const int rows = *rc::gen::inRange(1, 4), columns = *rc::gen::inRange(1, 4);
  const double spacing = *rc::gen::element(0.001, 0.06, 5.0);
  const double jitter = rows == 1 || columns == 1 ? 0 : *rc::gen::element(0.0, 0.1) * spacing;
  const Eigen::Vector3d far = random_origin();
  const Eigen::Matrix3d turn =
      *rc::gen::arbitrary<bool>() ? rotation() : Eigen::Matrix3d::Identity();
  schemas::RigDocument document;
  for (const auto& camera : camera_grid(rows, columns, spacing, image_width, image_height)) {
    document.cameras.push_back({camera, {}});
  }
  rig::Rig rig = rig::rig_from_document(document);
  for (rig::Rig::Camera& camera : rig.cameras) {
    camera.pose.position += Eigen::Vector3d(between(-jitter, jitter), between(-jitter, jitter),
                                            between(-jitter, jitter));
    camera.pose.position = turn * camera.pose.position + far;
    camera.pose.world_from_camera_rotation = turn;
  }
  return rig;
}

}  // namespace raystage::testing
