// SPDX-License-Identifier: Apache-2.0
// Fits two-plane light fields to a rig (thesis 2.3 and appendix A). Detects a lattice of cameras by
// least squares or lays a grid over them, and sizes the image plane by the finest source pixels and
// the visible area. A box divides cameras among six faces. Input: rig, camera indices. Output:
// slabs, metres. Cost: quadratic in cameras.

#include "render/slabs/slab.h"

#include <Eigen/Dense>
#include <algorithm>
#include <array>
#include <cmath>
#include <limits>
#include <optional>

#include "base/options.h"

namespace raystage::render {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector2d;
using Eigen::Vector3d;

constexpr int kMaxSide = 16384;  // samples of an image plane, per axis
constexpr int kMaxNodes = 1024;  // per axis

/// Nodes of one axis: first + k * spacing, k < count, in the slab's coordinates.
struct Axis {
  int count = 1;
  double first = 0, spacing = 0;
};

Axis spread(double low, double high, int count) {
  count = std::clamp(count, 1, kMaxNodes);
  if (count == 1) return {1, (low + high) / 2, 0};
  return {count, low, (high - low) / (count - 1)};
}

/// The grid indices of each camera, if all cameras lie on a lattice.
struct Lattice {
  std::vector<Vector2d> place;  // column, row
  Vector3d column_step, row_step;
};

std::optional<Lattice> lattice_of(const rig::Rig& rig, std::span<const int> cameras) {
  if (rig.topology_kind == "delaunay" || cameras.size() < 2) return std::nullopt;
  Lattice lattice;
  const auto count = static_cast<Eigen::Index>(cameras.size());
  Eigen::MatrixXd places(count, 3), centres(count, 3);
  const Vector3d origin = rig.cameras[cameras[0]].pose.position;
  for (Eigen::Index i = 0; i < count; ++i) {
    const rig::Rig::Camera& camera = rig.cameras[cameras[i]];
    if (!camera.row || !camera.column) return std::nullopt;
    lattice.place.emplace_back(*camera.column, *camera.row);
    places.row(i) << 1, *camera.column, *camera.row;
    centres.row(i) = (camera.pose.position - origin).transpose();
  }
  const Eigen::MatrixXd steps = places.completeOrthogonalDecomposition().solve(centres);
  lattice.column_step = steps.row(1).transpose();
  lattice.row_step = steps.row(2).transpose();
  const double residual = std::sqrt((places * steps - centres).rowwise().squaredNorm().mean());
  double least_step = std::numeric_limits<double>::infinity();
  for (const Vector3d& step : {lattice.column_step, lattice.row_step}) {
    if (step.norm() > 1e-9 * centres.norm()) least_step = std::min(least_step, step.norm());
  }
  // Larger residuals could confuse neighbours: the cameras are not on a lattice.
  if (!(residual < 0.25 * least_step)) return std::nullopt;
  return lattice;
}

/// Returns the axes across `facing`: x along the lattice's columns, or the cameras' mean right.
Matrix3d orientation_of(const rig::Rig& rig, std::span<const int> cameras, const Vector3d& facing,
                        const std::optional<Lattice>& lattice) {
  const auto in_plane = [&](const Vector3d& v) { return Vector3d(v - v.dot(facing) * facing); };
  Vector3d right = Vector3d::Zero();
  for (const int camera : cameras) {
    right += rig.cameras[camera].pose.world_from_camera_rotation.col(0);
  }
  right = in_plane(right);
  if (right.norm() < 1e-6 * static_cast<double>(cameras.size())) right = facing.unitOrthogonal();
  if (lattice) {
    const Vector3d columns = in_plane(lattice->column_step);
    const Vector3d rows = in_plane(lattice->row_step).cross(facing);  // a quarter turn
    const Vector3d along = columns.norm() >= 1e-3 * rows.norm() ? columns : rows;
    if (along.norm() > 0) right = along.dot(right) < 0 ? Vector3d(-along) : along;
  }
  Matrix3d rotation;
  rotation.col(0) = right.normalized();
  rotation.col(2) = -facing;
  rotation.col(1) = rotation.col(2).cross(rotation.col(0));
  return rotation;
}

/// Fits the lattice along one axis: indices (column or row) to coordinates.
Axis fit_axis(const std::vector<double>& places, const std::vector<double>& coordinates) {
  const auto count = static_cast<double>(places.size());
  double mean_place = 0, mean_coordinate = 0, covariance = 0, variance = 0;
  for (std::size_t i = 0; i < places.size(); ++i) {
    mean_place += places[i] / count;
    mean_coordinate += coordinates[i] / count;
  }
  for (std::size_t i = 0; i < places.size(); ++i) {
    covariance += (places[i] - mean_place) * (coordinates[i] - mean_coordinate);
    variance += (places[i] - mean_place) * (places[i] - mean_place);
  }
  if (variance == 0) return {1, mean_coordinate, 0};
  const auto [least, most] = std::ranges::minmax(places);
  const double step = covariance / variance;
  const double first = mean_coordinate + ((step > 0 ? least : most) - mean_place) * step;
  return {static_cast<int>(most - least) + 1, first, std::abs(step)};
}

/// Returns the median distance from a camera to its nearest neighbour.
double median_spacing(const std::vector<Vector2d>& centres) {
  std::vector<double> nearest;
  for (const Vector2d& from : centres) {
    double least = std::numeric_limits<double>::infinity();
    for (const Vector2d& to : centres) {
      if (const double d = (to - from).norm(); d > 0) least = std::min(least, d);
    }
    if (std::isfinite(least)) nearest.push_back(least);
  }
  if (nearest.empty()) return 0;
  std::ranges::sort(nearest);
  return nearest[nearest.size() / 2];
}

/// Fits nodes along the slab's x and -y to the cameras' positions in its plane.
std::array<Axis, 2> fit_axes(const std::vector<Vector2d>& centres,
                             const std::optional<Lattice>& lattice, const SlabOptions& options) {
  std::array<Axis, 2> axes;
  const std::array<int, 2> asked{options.columns, options.rows};
  std::array<Vector2d, 2> range;
  for (int k = 0; k < 2; ++k) {
    Vector2d& r = range[k];
    r = {centres[0][k], centres[0][k]};
    for (const Vector2d& c : centres) r = {std::min(r[0], c[k]), std::max(r[1], c[k])};
  }
  const double extent = std::max(range[0][1] - range[0][0], range[1][1] - range[1][0]);
  // At most four nodes per camera.
  const double density = std::max(
      median_spacing(centres), std::sqrt((range[0][1] - range[0][0]) * (range[1][1] - range[1][0]) /
                                         4 / static_cast<double>(centres.size())));
  for (std::size_t k = 0; k < 2; ++k) {
    const double low = range[k][0], high = range[k][1];
    if (high - low <= 1e-7 * extent) {
      axes[k] = {1, (low + high) / 2, 0};
    } else if (lattice) {
      std::vector<double> places, coordinates;
      for (std::size_t i = 0; i < centres.size(); ++i) {
        places.push_back(lattice->place[i][static_cast<int>(k)]);
        coordinates.push_back(centres[i][static_cast<int>(k)]);
      }
      axes[k] = fit_axis(places, coordinates);
    } else {
      axes[k] = spread(low, high, static_cast<int>(std::ceil((high - low) / density - 1e-6)) + 1);
    }
    if (asked[k] > 0 && axes[k].count > 1) {
      axes[k] =
          spread(axes[k].first, axes[k].first + axes[k].spacing * (axes[k].count - 1), asked[k]);
    }
  }
  return axes;
}

/// The area that cameras see on the image plane at distance 1, and its sampling density.
struct VisibleArea {
  Vector2d low = Vector2d::Constant(std::numeric_limits<double>::infinity());
  Vector2d high = -low;
  Vector2d samples = Vector2d::Zero();  // per unit of u and of v
};

void see(const rig::Rig::Camera& camera, const Matrix3d& slab_from_world, double limit,
         VisibleArea& sight) {
  constexpr int kSteps = 32;
  const Matrix3d rotation = slab_from_world * camera.pose.world_from_camera_rotation;
  const auto seen = [&](double x, double y) -> std::optional<Vector3d> {
    const auto ray = camera.model.unproject({x, y});
    if (!ray) return std::nullopt;
    return Vector3d(rotation * *ray);
  };
  const auto on_plane = [](const Vector3d& d) { return Vector2d(d.x() / -d.z(), d.y() / d.z()); };
  for (int row = 0; row <= kSteps; ++row) {
    for (int column = 0; column <= kSteps; ++column) {
      const double x = camera.model.width() * column / double{kSteps};
      const double y = camera.model.height() * row / double{kSteps};
      const auto ray = seen(x, y);
      if (!ray || !(ray->z() < 0)) continue;
      const Vector2d unbounded = on_plane(*ray);
      const Vector2d uv = unbounded.cwiseMax(-limit).cwiseMin(limit);
      sight.low = sight.low.cwiseMin(uv);
      sight.high = sight.high.cwiseMax(uv);
      const auto right = seen(x + 1, y), below = seen(x, y + 1);
      if (uv != unbounded || !right || !below || right->z() >= 0 || below->z() >= 0) continue;
      Eigen::Matrix2d plane_from_pixel;
      plane_from_pixel << on_plane(*right) - uv, on_plane(*below) - uv;
      const Eigen::Matrix2d pixel_from_plane = plane_from_pixel.inverse();
      if (!pixel_from_plane.allFinite()) continue;
      sight.samples = sight.samples.cwiseMax(pixel_from_plane.colwise().norm().transpose());
    }
  }
}

/// Sets the image plane of all nodes; width is 0 where no camera sees any of it.
void fit_image_plane(const rig::Rig& rig, const SlabOptions& options, Slab& slab) {
  VisibleArea sight;
  const Matrix3d slab_from_world = slab.pose.world_from_camera_rotation.transpose();
  for (const int camera : slab.cameras) {
    see(rig.cameras[camera], slab_from_world, std::tan(options.max_fov / 2), sight);
  }
  if (!(sight.samples.minCoeff() > 0)) return;
  const Vector2d extent = sight.high - sight.low;
  const Vector2d samples = (sight.samples * options.uv_scale)
                               .cwiseMin(Vector2d::Constant(kMaxSide - 2).cwiseQuotient(extent));
  const schemas::Intrinsics& first = rig.cameras[slab.cameras[0]].model.intrinsics();
  // The left border lies in the first sample; sample centres coincide with the first camera's.
  const auto principal = [](double least, double of_camera) {
    return of_camera + std::ceil(least - of_camera - 1e-6);
  };
  slab.image.fx = samples.x();
  slab.image.fy = samples.y();
  slab.image.cx = principal(-sight.low.x() * samples.x(), first.cx);
  slab.image.cy = principal(-sight.low.y() * samples.y(), first.cy);
  const auto side = [](double last) {
    return std::max(1, static_cast<int>(std::ceil(last - 1e-6)));
  };
  slab.width = side(sight.high.x() * samples.x() + slab.image.cx);
  slab.height = side(sight.high.y() * samples.y() + slab.image.cy);
}

Slab fit_slab(const rig::Rig& rig, std::vector<int> cameras, const Vector3d& facing,
              const SlabOptions& options) {
  Slab slab;
  slab.cameras = std::move(cameras);
  const auto lattice = lattice_of(rig, slab.cameras);
  slab.pose.world_from_camera_rotation = orientation_of(rig, slab.cameras, facing, lattice);
  const Vector3d origin = rig.cameras[slab.cameras[0]].pose.position;
  std::vector<Vector2d> centres;  // x, -y in the slab's frame
  double mean_z = 0;
  for (const int camera : slab.cameras) {
    const Vector3d c = slab.pose.world_from_camera_rotation.transpose() *
                       (rig.cameras[camera].pose.position - origin);
    centres.emplace_back(c.x(), -c.y());
    mean_z += c.z() / static_cast<double>(slab.cameras.size());
  }
  const auto axes = fit_axes(centres, lattice, options);
  slab.columns = axes[0].count;
  slab.rows = axes[1].count;
  slab.column_spacing = axes[0].spacing;
  slab.row_spacing = axes[1].spacing;
  slab.pose.position = origin + slab.pose.world_from_camera_rotation *
                                    Vector3d(axes[0].first, -axes[1].first, mean_z);
  fit_image_plane(rig, options, slab);
  return slab;
}

/// Returns the box's axes as columns: the rotation that best aligns its faces with the cameras.
Matrix3d box_of(const rig::Rig& rig, std::span<const int> cameras) {
  Matrix3d box = rig.cameras[cameras[0]].pose.world_from_camera_rotation;
  const Matrix3d start = box;
  for (int round = 0; round < 8; ++round) {
    Matrix3d pull = 1e-6 * start;  // regularises rotations that the cameras do not determine
    for (const int camera : cameras) {
      const Vector3d in_box = box.transpose() * rig.cameras[camera].pose.viewing_direction();
      Eigen::Index axis = 0;
      in_box.cwiseAbs().maxCoeff(&axis);
      Vector3d face = Vector3d::Zero();
      face[axis] = in_box[axis] < 0 ? -1 : 1;
      pull += box * in_box * face.transpose();  // viewing direction times face
    }
    const Eigen::JacobiSVD<Matrix3d> svd(pull, Eigen::ComputeFullU | Eigen::ComputeFullV);
    Matrix3d turned = svd.matrixU() * svd.matrixV().transpose();
    if (turned.determinant() < 0) {
      Matrix3d mirrored = svd.matrixU();
      mirrored.col(2) *= -1;
      turned = mirrored * svd.matrixV().transpose();
    }
    const bool settled = (turned - box).norm() < 1e-12;
    box = turned;
    if (settled) break;
  }
  return box;
}

}  // namespace

Vector3d Slab::node_position(int column, int row) const {
  return pose.position +
         pose.world_from_camera_rotation * Vector3d(column * column_spacing, -row * row_spacing, 0);
}

VirtualCamera Slab::node_view(int column, int row) const {
  return {width, height, image, {pose.world_from_camera_rotation, node_position(column, row)}};
}

bool SlabOptions::is_valid(std::string* reason) const {
  return is_within("columns", columns, 0, kMaxNodes, reason) &&
         is_within("rows", rows, 0, kMaxNodes, reason) &&
         is_within("uv_scale", uv_scale, 1e-3, 1000, reason) &&
         is_within("max_fov (radians)", max_fov, 1e-3, M_PI, reason);
}

std::vector<Slab> fit_slabs(const rig::Rig& rig, std::span<const int> cameras,
                            const Vector3d& normal, const SlabOptions& options) {
  require_valid(options, "slabs");
  if (options.layout == SlabOptions::Layout::kSingle) {
    return {fit_slab(rig, {cameras.begin(), cameras.end()}, -normal, options)};
  }
  const Matrix3d box = box_of(rig, cameras);
  std::array<std::vector<int>, 6> members;
  std::array<Vector3d, 6> facing;
  for (std::size_t face = 0; face < 6; ++face) {
    facing[face] = (face % 2 == 0 ? -1.0 : 1.0) * box.col(2 - static_cast<Eigen::Index>(face / 2));
  }
  for (const int camera : cameras) {
    const Vector3d looks = rig.cameras[camera].pose.viewing_direction();
    const auto along = [&](const Vector3d& face) { return face.dot(looks); };
    members[std::ranges::max_element(facing, {}, along) - facing.begin()].push_back(camera);
  }
  std::vector<Slab> slabs;
  for (std::size_t face = 0; face < 6; ++face) {
    if (members[face].empty()) continue;
    slabs.push_back(fit_slab(rig, std::move(members[face]), facing[face], options));
    for (std::size_t other = 0; other < 6; ++other) {
      if (other != face) slabs.back().competing_axes.push_back(facing[other]);
    }
  }
  return slabs;
}

}  // namespace raystage::render
