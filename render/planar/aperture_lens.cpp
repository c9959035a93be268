// SPDX-License-Identifier: Apache-2.0
// Camera weights of a synthetic aperture (formula: aperture_lens.h), and thin-lens conversion of
// f-number to radius in metres. Cost: constant per camera and ray.
#include "render/planar/aperture_lens.h"

#include <fmt/format.h>

#include <Eigen/Geometry>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <numbers>
#include <string>

#include "base/error.h"
#include "render/common/plane_projection.h"

namespace raystage::render {
namespace {

constexpr std::array kOptions{
    number_option(
        "radius", 0, 0, 1e6,
        "radius of the aperture on the array's surface, m; 0 or less than the distance between "
        "neighbouring cameras: that distance"),
    number_option("f_number", 0, 0, 1e6, "f-number of the lens, instead of radius; 0: use radius"),
    number_option("film_width", 36, 0.1, 1e6, "width of the film back for f_number, mm"),
    number_option("focus_distance", 0, 0, 1e9,
                  "focus distance along the view's axis, m; 0: the focal plane"),
    text_option(
        "depth_map", "",
        "EXR file of the view's size, relative to the take's folder: focuses at its channel Z "
        "(planar depth in the view, m) instead of a plane"),
    choice_option("shape", "round", "round|square|hexagon|octagon", "shape of the aperture"),
    number_option("soft_edge", 1, 0.01, 1, "fraction of the radius in which the weight falls to 0"),
};

/// Returns axes of the array's plane: the cameras' mean right, projected onto it, and up.
Eigen::Matrix<double, 2, 3> plane_axes(const rig::Rig& rig, const Eigen::Vector3d& normal) {
  Eigen::Vector3d right = Eigen::Vector3d::Zero();
  for (const rig::Rig::Camera& camera : rig.cameras) {
    right += camera.pose.world_from_camera_rotation.col(0);
  }
  right -= normal * normal.dot(right);
  if (right.norm() < 1e-6 * static_cast<double>(rig.cameras.size())) {
    right = normal.unitOrthogonal();
  }
  right.normalize();
  Eigen::Matrix<double, 2, 3> axes;
  axes << right.transpose(), normal.cross(right).transpose();
  return axes;
}

std::vector<Eigen::Vector2d> sides_of(const std::string& shape) {
  const int pairs = shape == "square" ? 2 : shape == "hexagon" ? 3 : shape == "octagon" ? 4 : 0;
  std::vector<Eigen::Vector2d> sides;
  for (int i = 0; i < pairs; ++i) {
    const double angle = std::numbers::pi * i / pairs;
    sides.emplace_back(std::cos(angle), std::sin(angle));
  }
  return sides;
}

/// Returns the largest distance from each camera to a neighbour, m.
std::vector<double> max_neighbour_distances(const rig::Rig& rig, const rig::Topology& topology) {
  std::vector<double> longest(rig.cameras.size());
  for (const rig::Topology::Cell& cell : topology.cells) {
    for (const int from : cell) {
      for (const int to : cell) {
        if (from < 0 || to < 0) continue;
        const auto i = static_cast<std::size_t>(from), j = static_cast<std::size_t>(to);
        longest[i] = std::max(longest[i],
                              (rig.cameras[i].pose.position - rig.cameras[j].pose.position).norm());
      }
    }
  }
  return longest;
}

}  // namespace

void check_aperture_options(const MethodOptions& options) {
  if (options.number("f_number") > 0 && options.number("radius") > 0) {
    throw Error::bad_input("both options radius and f_number are set", "method aperture",
                           "Set only one of them");
  }
}

ApertureLens::ApertureLens(const VirtualCamera& view, const LightFieldFrame& instant,
                           const Eigen::Vector4d& focal_plane, const MethodOptions& options) {
  check_aperture_options(options);
  double radius = options.number("radius");
  if (const double f_number = options.number("f_number"); f_number > 0) {
    const schemas::Intrinsics& k = view.intrinsics;
    const double depth = PlaneProjection(view, focal_plane).depth(k.cx, k.cy);
    radius = aperture_radius(view, f_number, options.number("film_width"),
                             depth > 0 ? depth : std::numeric_limits<double>::infinity());
  }
  const double soft = options.number("soft_edge");
  steepness_ = 1 / (1 - (1 - soft) * (1 - soft));
  sides_ = sides_of(options.text("shape"));

  const rig::Rig& rig = *instant.rig;
  outwards_ = instant.present->outwards;
  up_ = instant.present->up;
  array_plane_.axes = plane_axes(rig, instant.complete->normal);
  const Eigen::Vector3d centre = rig.centre();
  const std::vector<double> present = max_neighbour_distances(rig, *instant.present);
  const std::vector<double> complete = max_neighbour_distances(rig, *instant.complete);
  const bool alone = instant.present->kind == rig::Topology::Kind::kPoint;
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    const bool is_present = instant.is_present(static_cast<int>(i));
    Camera camera;
    camera.position = rig.cameras[i].pose.position - centre;
    camera.radius = std::max(radius, is_present ? present[i] : complete[i]);
    if (!is_present && complete[i] == 0) camera.radius = 0;  // excluded or replaced
    if (alone && is_present) camera.radius = std::numeric_limits<double>::infinity();
    cameras_.push_back(camera);
  }
  double least = 0;
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    if (instant.is_present(static_cast<int>(i))) least = std::max(least, present[i]);
  }
  if (radius > 0 && radius < least) {
    note_ = fmt::format(
        "the requested aperture radius of {:.3g} mm is smaller than the distance between "
        "neighbouring cameras: a radius of up to {:.3g} mm is used",
        radius * 1e3, least * 1e3);
  }
}

ApertureLens::Plane ApertureLens::plane_of(const RayCells::Cell& cell) const {
  if (!outwards_) return array_plane_;
  const auto corner = [&](std::size_t i) { return cameras_[cell.camera[i]].position; };
  const Eigen::Vector3d edge = corner(1) - corner(0);
  Plane plane;
  plane.normal = edge.cross(cell.count == 3 ? Eigen::Vector3d(corner(2) - corner(0)) : up_);
  plane.normal.normalize();
  plane.height = plane.normal.dot(corner(0));
  Eigen::Vector3d right = up_.cross(plane.normal);
  if (right.norm() < 1e-6) right = plane.normal.unitOrthogonal();
  right.normalize();
  plane.axes << right.transpose(), plane.normal.cross(right).transpose();
  return plane;
}

Eigen::Vector2d ApertureLens::place_of(const RayCells::Cell& cell, const Plane& plane,
                                       const RayCells::Crossing& crossing) const {
  Eigen::Vector2d place = Eigen::Vector2d::Zero();
  for (int i = 0; i < cell.count; ++i) {
    place += crossing.weight[i] * plane.place_of(cameras_[cell.camera[i]]);
  }
  return place;
}

double ApertureLens::weight(const Camera& camera, const Plane& plane,
                            const Eigen::Vector2d& place) const {
  if (camera.radius == 0) return 0;
  const Eigen::Vector2d way = (place - plane.place_of(camera)) / camera.radius;
  double q = sides_.empty() ? way.norm() : 0;
  for (const Eigen::Vector2d& side : sides_) q = std::max(q, std::abs(side.dot(way)));
  const double q_squared = q * q + plane.relative_height_squared(camera);
  const double t = std::clamp((1 - q_squared) * steepness_, 0.0, 1.0);
  return t * t * (3 - 2 * t);
}

double aperture_radius(const VirtualCamera& view, double f_number, double film_width,
                       double focus_distance) {
  const double image_distance = film_width * 1e-3 * view.intrinsics.fx / view.width;
  return 0.5 / (f_number * (1 / image_distance + 1 / focus_distance));
}

Eigen::Vector4d view_parallel_plane(const VirtualCamera& view, double distance) {
  const Eigen::Vector3d ahead = -view.pose.world_from_camera_rotation.col(2);
  return {ahead.x(), ahead.y(), ahead.z(), -(ahead.dot(view.pose.position) + distance)};
}

std::span<const OptionSpec> aperture_options() { return kOptions; }

}  // namespace raystage::render
