// SPDX-License-Identifier: Apache-2.0
// Divides fisheyes into faces of a cube. What a frame shows is found by rays of a lattice of its
// pixels. Cost: a thousand rays per camera and face.
#include "rig/pinhole_facets.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <numbers>

namespace raystage::rig {
namespace {

constexpr double kWidestPinhole = 62 * std::numbers::pi / 180;  // half angle, radians
/// Between the axes of images (y down, z ahead) and those of cameras (y up, -z ahead).
const Eigen::Matrix3d kFlip = Eigen::Vector3d(1, -1, -1).asDiagonal();
constexpr int kLattice = 32;  // steps along each side of a frame

/// Returns directions (x right, y down, z ahead) of the lens that a frame records.
std::vector<Eigen::Vector3d> recorded_directions(const CameraModel& model) {
  std::vector<Eigen::Vector3d> directions;
  for (int row = 0; row <= kLattice; ++row) {
    for (int column = 0; column <= kLattice; ++column) {
      const auto ray = model.unproject({static_cast<double>(model.width()) * column / kLattice,
                                        static_cast<double>(model.height()) * row / kLattice});
      if (ray) directions.emplace_back(ray->x(), -ray->y(), -ray->z());
    }
  }
  return directions;
}

/// Returns the rotations of a cube's faces: ahead, right, left, up, down, back.
std::array<Eigen::Matrix3d, 6> faces() {
  const auto turned = [](double degrees, const Eigen::Vector3d& axis) {
    return Eigen::AngleAxisd(degrees * std::numbers::pi / 180, axis).toRotationMatrix();
  };
  return {Eigen::Matrix3d::Identity(),           turned(90, Eigen::Vector3d::UnitY()),
          turned(-90, Eigen::Vector3d::UnitY()), turned(90, Eigen::Vector3d::UnitX()),
          turned(-90, Eigen::Vector3d::UnitX()), turned(180, Eigen::Vector3d::UnitY())};
}

/// Returns the part of a face that shows some of the directions, or nullopt if other faces show all
/// of them.
std::optional<Facet> facet_of_face(const Eigen::Matrix3d& lens_from_facet,
                                   const std::vector<Eigen::Vector3d>& directions) {
  Facet facet;
  facet.lens_from_facet = lens_from_facet;
  facet.left = facet.top = Facet::kReach;
  facet.right = facet.bottom = -Facet::kReach;
  bool is_needed = false;
  for (const Eigen::Vector3d& direction : directions) {
    const Eigen::Vector3d of_facet = lens_from_facet.transpose() * direction;
    if (!(of_facet.z() > 0)) continue;
    const Eigen::Vector2d ideal = of_facet.hnormalized();
    const double farthest = ideal.cwiseAbs().maxCoeff();
    if (farthest > Facet::kReach) continue;
    is_needed = is_needed || farthest <= 1;
    facet.left = std::min(facet.left, ideal.x());
    facet.right = std::max(facet.right, ideal.x());
    facet.top = std::min(facet.top, ideal.y());
    facet.bottom = std::max(facet.bottom, ideal.y());
  }
  if (!is_needed) return std::nullopt;
  // What lies between the lattice's rays.
  constexpr double kMargin = 0.15;
  facet.left = std::max(facet.left - kMargin, -Facet::kReach);
  facet.right = std::min(facet.right + kMargin, Facet::kReach);
  facet.top = std::max(facet.top - kMargin, -Facet::kReach);
  facet.bottom = std::min(facet.bottom + kMargin, Facet::kReach);
  return facet;
}

/// Returns axes of the array (columns: right, up, back; world): it looks ahead if it looks
/// anywhere, otherwise they are those of the world.
Eigen::Matrix3d array_axes(const Rig& rig) {
  constexpr double kAligned = 0.5;
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Rig::Camera& camera : rig.cameras) sum += camera.pose.viewing_direction();
  if (sum.norm() < kAligned * static_cast<double>(rig.cameras.size())) {
    return Eigen::Matrix3d::Identity();
  }
  const Eigen::Vector3d back = -sum.normalized();
  const Eigen::Vector3d up =
      std::abs(back.y()) < 0.9 ? Eigen::Vector3d::UnitY() : Eigen::Vector3d::UnitZ();
  const Eigen::Vector3d right = up.cross(back).normalized();
  Eigen::Matrix3d axes;
  axes << right, back.cross(right), back;
  return axes;
}

std::vector<Facet> facets_of(const Rig::Camera& camera, const Eigen::Matrix3d& array) {
  const CameraModel& model = camera.model;
  if (model.fisheye() == nullptr) return {};
  const std::vector<Eigen::Vector3d> directions = recorded_directions(model);
  const double largest = std::min(std::cos(kWidestPinhole), 1.0);
  const bool is_wide = std::ranges::any_of(directions, [&](const Eigen::Vector3d& direction) {
    return direction.z() < largest * direction.norm();
  });
  if (!is_wide) return {};
  std::vector<Facet> facets;
  // The faces of all cameras are parallel: a face of one shows what those of its neighbours show.
  const Eigen::Matrix3d lens_from_array =
      kFlip * camera.pose.world_from_camera_rotation.transpose() * array * kFlip;
  for (const Eigen::Matrix3d& face : faces()) {
    std::optional<Facet> facet = facet_of_face(lens_from_array * face, directions);
    if (!facet) continue;
    const schemas::Intrinsics& k = model.intrinsics();
    facet->focal_length = (k.fx + k.fy) / 2 * model.fisheye()->slope(0);
    facets.push_back(*facet);
  }
  return facets;
}

}  // namespace

std::optional<FacetedRig> pinhole_facets(const Rig& rig) {
  std::vector<std::vector<Facet>> facets;
  const Eigen::Matrix3d array = array_axes(rig);
  for (const Rig::Camera& camera : rig.cameras) facets.push_back(facets_of(camera, array));
  if (std::ranges::all_of(facets, [](const auto& of_camera) { return of_camera.empty(); })) {
    return std::nullopt;
  }
  FacetedRig result;
  result.rig.topology_kind = rig.topology_kind;
  result.rig.array = std::make_shared<const Rig>(rig);
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    const Rig::Camera& camera = rig.cameras[i];
    const auto add = [&](Rig::Camera facet) {
      result.rig.cameras.push_back(std::move(facet));
      result.camera_of_facet.push_back(static_cast<int>(i));
    };
    if (facets[i].empty()) {
      add(camera);
      continue;
    }
    for (const Facet& facet : facets[i]) {
      Rig::Camera part = camera;
      part.model = camera.model.with_facet(facet);
      part.pose.world_from_camera_rotation =
          camera.pose.world_from_camera_rotation * (kFlip * facet.lens_from_facet * kFlip);
      add(std::move(part));
    }
  }
  return result;
}

}  // namespace raystage::rig
