// SPDX-License-Identifier: Apache-2.0
#include "rig/rig.h"

#include <algorithm>
#include <cassert>
#include <cmath>
#include <iterator>
#include <numbers>
#include <optional>
#include <set>
#include <utility>

#include "base/error.h"
#include "rig/outward_topology.h"

namespace raystage::rig {

Eigen::Vector3d Rig::centre() const {
  if (array) return array->centre();
  // Relative to the first camera, so that an array far from the origin loses no precision.
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Camera& camera : cameras) sum += camera.pose.position - cameras[0].pose.position;
  return cameras[0].pose.position + sum / static_cast<double>(cameras.size());
}

Eigen::Vector3d Rig::mean_viewing_direction() const {
  if (array) return array->mean_viewing_direction();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  for (const Camera& camera : cameras) sum += camera.pose.viewing_direction();
  // Cameras that look in all directions have no mean direction: use the first camera's.
  if (sum.norm() <= 1e-9) return cameras[0].pose.viewing_direction().normalized();
  return sum.normalized();
}

namespace {

/// Returns the ray at the end of a fisheye's circle towards a pixel.
Eigen::Vector3d ray_at_the_end(const CameraModel& model, const Eigen::Vector2d& pixel) {
  const schemas::Intrinsics& lens = model.intrinsics();
  const Eigen::Vector2d image((pixel.x() - lens.cx) / lens.fx, (pixel.y() - lens.cy) / lens.fy);
  const double angle = model.fisheye()->largest_angle();
  const Eigen::Vector2d across = std::sin(angle) * image.normalized();
  return {across.x(), -across.y(), -std::cos(angle)};
}

/// Returns the largest angle between a ray that a camera records and a direction, radians, from
/// rays of the picture's border, or of the circle of the lens where that is within the picture; for
/// fisheyes.
double farthest_recorded(const Rig::Camera& camera, const Eigen::Vector3d& direction) {
  constexpr int kParts = 16;  // of each side
  const Eigen::Vector3d axis = camera.pose.viewing_direction();
  const double of_axis = std::atan2(axis.cross(direction).norm(), axis.dot(direction));
  double farthest = of_axis;
  for (int i = 0; i < 4 * kParts; ++i) {
    const double part = static_cast<double>(i % kParts) / kParts;
    const double x = i < kParts ? part : i < 2 * kParts ? 1 : i < 3 * kParts ? 1 - part : 0;
    const double y = i < kParts ? 0 : i < 2 * kParts ? part : i < 3 * kParts ? 1 : 1 - part;
    const Eigen::Vector2d pixel(x * camera.model.width(), y * camera.model.height());
    const Eigen::Vector3d ray =
        camera.model.unproject(pixel).value_or(ray_at_the_end(camera.model, pixel));
    const Eigen::Vector3d towards = camera.pose.world_from_camera_rotation * ray;
    farthest =
        std::max(farthest, std::atan2(towards.cross(direction).norm(), towards.dot(direction)));
  }
  return farthest;
}

}  // namespace

bool Rig::looks_around() const {
  if (array) return array->looks_around();
  // Beyond this angle a plane in front of the array is several times as far as nearest to it.
  constexpr double kAhead = 75 * std::numbers::pi / 180;
  constexpr double kAligned = 0.8, kOutwards = 0.1;
  const Eigen::Vector3d middle = centre(), mean = mean_viewing_direction();
  Eigen::Vector3d sum = Eigen::Vector3d::Zero();
  double outwards = 0;
  for (const Camera& camera : cameras) {
    const Eigen::Vector3d axis = camera.pose.viewing_direction();
    sum += axis;
    const Eigen::Vector3d from_middle = camera.pose.position - middle;
    if (from_middle.norm() > 0) outwards += axis.dot(from_middle.normalized());
    if (camera.model.fisheye() != nullptr && farthest_recorded(camera, mean) > kAhead) return true;
  }
  const auto count = static_cast<double>(cameras.size());
  return sum.norm() < kAligned * count && outwards > kOutwards * count;
}

double Rig::depth_of(const Eigen::Vector3d& point) const {
  const Eigen::Vector3d from_centre = point - centre();
  return looks_around() ? from_centre.norm() : mean_viewing_direction().dot(from_centre);
}

Rig rig_from_document(const schemas::RigDocument& document) {
  if (document.cameras.empty()) {
    throw Error::bad_input("the rig contains no camera", document.name, "Give at least one camera");
  }
  Rig rig;
  rig.topology_kind = document.topology;
  for (const schemas::RigDocument::Camera& camera : document.cameras) {
    const schemas::CameraGeometry& geometry = camera.geometry;
    if (document.topology == "grid" && !(geometry.row && geometry.column)) {
      throw Error::bad_input("the camera has no row and column, but the rig's topology is \"grid\"",
                             "camera " + geometry.id,
                             "Give \"row\" and \"col\", or set \"topology\" to \"auto\"");
    }
    rig.cameras.push_back({geometry.id, CameraModel(geometry),
                           pose_from_matrix(geometry.world_from_camera), camera.photometric,
                           geometry.row, geometry.column, geometry.line_time_us});
  }
  return rig;
}

std::vector<int> cameras_off_grid_step(const Rig& rig, int step) {
  std::vector<int> off;
  if (step <= 1) return off;
  // By rank, not by index: the rows of a grid may be 0, 2, 4.
  std::set<int> rows, columns;
  for (const Rig::Camera& camera : rig.cameras) {
    if (!camera.row || !camera.column) {
      throw Error::bad_input("camera '" + camera.id + "' has no row and column in the rig's grid",
                             "rig.json", "Choose cameras by their ids instead of every n-th");
    }
    rows.insert(*camera.row);
    columns.insert(*camera.column);
  }
  const auto kept = [step](const std::set<int>& numbers, int number) {
    return std::distance(numbers.begin(), numbers.find(number)) % step == 0;
  };
  for (std::size_t i = 0; i < rig.cameras.size(); ++i) {
    const Rig::Camera& camera = rig.cameras[i];
    if (!kept(rows, *camera.row) || !kept(columns, *camera.column))
      off.push_back(static_cast<int>(i));
  }
  return off;
}

Topology make_topology(const Rig& rig, std::span<const int> cameras) {
  std::vector<Eigen::Vector3d> centres, directions;
  std::vector<int> rows, columns;
  for (const int index : cameras) {
    const Rig::Camera& camera = rig.cameras[index];
    centres.push_back(camera.pose.position);
    directions.push_back(camera.pose.viewing_direction());
    if (camera.row && camera.column) {
      rows.push_back(*camera.row);
      columns.push_back(*camera.column);
    }
  }
  const bool grid = rig.topology_kind != "delaunay" && rows.size() == cameras.size();
  std::optional<Topology> outward = outward_topology(centres, directions);
  Topology topology = outward ? *std::move(outward)
                      : grid  ? grid_topology(centres, directions, rows, columns)
                              : delaunay_topology(centres, directions);
  for (Topology::Cell& cell : topology.cells) {
    for (int& corner : cell) {
      if (corner >= 0) corner = cameras[corner];
    }
  }
  return topology;
}

namespace {

Eigen::Vector4d plane_ahead(const Rig& rig, const Eigen::Vector3d& normal, double depth) {
  assert(!std::isnan(depth));
  if (std::isinf(depth)) return {0, 0, 0, 1};
  return {normal.x(), normal.y(), normal.z(), -(normal.dot(rig.centre()) + depth)};
}

}  // namespace

Eigen::Vector4d fronto_parallel_plane(const Rig& rig, double depth) {
  return plane_ahead(rig, rig.mean_viewing_direction(), depth);
}

Eigen::Vector4d fronto_parallel_plane(const Rig& rig, double depth,
                                      const Eigen::Vector3d& viewing_direction) {
  if (!rig.looks_around()) return fronto_parallel_plane(rig, depth);
  return plane_ahead(rig, viewing_direction, depth);
}

double optimal_focal_depth(schemas::DepthRange range) {
  if (!(range.near > 0 && range.far >= range.near && std::isfinite(range.near))) {
    throw Error::bad_input("the depth range is invalid", "depth_range",
                           "Give 0 < near <= far, in metres; far may be infinite");
  }
  // Avoids 1 / near, which overflows for the smallest depths. Exact if near = far.
  return range.near / (0.5 + 0.5 * (range.near / range.far));
}

}  // namespace raystage::rig
