// SPDX-License-Identifier: Apache-2.0
// Finds the cell of the array's topology that each ray of a view crosses (thesis 4.1.2), and the
// barycentric weights of its cameras. Weights are linear functions of the pixel (see ray_cells.h),
// so that a row of pixels is cut into spans by the sign of three functions per cell. Input: view
// without distortion, rig, topology. Output: spans per row. Cost: cells per row plus pixels.

#include "render/common/ray_cells.h"

#include <Eigen/Geometry>
#include <algorithm>
#include <cmath>
#include <limits>

namespace raystage::render {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

constexpr double kEpsilon = std::numeric_limits<double>::epsilon();

/// Smallest edge tolerance: views on the array's own edge see its outermost cameras along that
/// edge.
constexpr double kEdgeTolerance = 1e-9;

/// Returns (b - o) x (c - o), the plane through o and an edge, accurate far from the edge.
/// Exchanging b and c gives the exact negative, so that neighbouring cells have no gap or overlap.
Vector3d plane_through_edge(const Vector3d& o, const Vector3d& b, const Vector3d& c, bool swap) {
  return swap ? Vector3d(-(c - o).cross(b - c)) : Vector3d((b - o).cross(c - b));
}

RayCells::Cell make_cell(const rig::Topology::Cell& indices, const rig::Topology& topology,
                         const rig::Rig& rig, const Vector3d& eye, const Matrix3d& ray_from_pixel) {
  RayCells::Cell cell;
  std::array<Vector3d, 3> centre;
  for (const int index : indices) {
    if (index < 0) continue;
    const auto i = static_cast<std::size_t>(cell.count++);
    cell.camera[i] = index;
    centre[i] = rig.cameras[index].pose.position;
  }
  const auto on_pixels = [&](const Vector3d& on_rays) {
    return Vector3d(ray_from_pixel.transpose() * on_rays);
  };
  if (cell.count == 3) {
    for (std::size_t i = 0; i < 3; ++i) {
      const std::size_t j = (i + 1) % 3, k = (i + 2) % 3;
      cell.share[i] =
          on_pixels(plane_through_edge(eye, centre[j], centre[k], cell.camera[j] > cell.camera[k]));
    }
    cell.total = on_pixels((centre[1] - centre[0]).cross(centre[2] - centre[0]));
  } else if (cell.count == 2) {  // an endless strip along topology.up
    cell.share[0] = on_pixels((centre[1] - eye).cross(topology.up));
    cell.share[1] = on_pixels(topology.up.cross(centre[0] - eye));
    cell.total = on_pixels((centre[1] - centre[0]).cross(topology.up));
  } else {
    cell.share[0] = cell.total = Vector3d::UnitZ();
  }
  return cell;
}

/// Returns the tolerance of a cell's edges. For a distant virtual camera, the crossing of a cell is
/// accurate to a few units in the last place of its distance. Neighbouring cells extend by as much,
/// so that no ray falls between them.
double edge_tolerance(const RayCells::Cell& cell, const rig::Rig& rig, const Vector3d& eye) {
  if (cell.count < 2) return 0;
  const auto centre = [&](std::size_t i) { return rig.cameras[cell.camera[i]].pose.position; };
  double distance = 0, longest = 0;
  for (int i = 0; i < cell.count; ++i) {
    distance = std::max(distance, (centre(i) - eye).norm());
    longest = std::max(longest,
                       (centre((i + 1) % static_cast<std::size_t>(cell.count)) - centre(i)).norm());
  }
  double width = longest;
  if (cell.count == 3) {
    width = (centre(1) - centre(0)).cross(centre(2) - centre(0)).norm() / longest;
  }
  return kEdgeTolerance + 8 * kEpsilon * distance / width;
}

/// Sets weights that rounding keeps below the tolerance to 0, so that the camera's frame need not
/// be decoded. This is the third camera's weight for a virtual camera in the array's plane, on the
/// edge between the other two.
void drop_shares_below_tolerance(RayCells::Cell& cell, const VirtualCamera& view) {
  const auto range_of = [&](const Vector3d& linear) {
    double least = linear.z(), most = linear.z();
    for (const double x : {0.0, static_cast<double>(view.width)}) {
      for (const double y : {0.0, static_cast<double>(view.height)}) {
        const double value = linear.dot(Vector3d(x, y, 1));
        least = std::min(least, value);
        most = std::max(most, value);
      }
    }
    return std::pair(least, most);
  };
  const auto [least, most] = range_of(cell.total);
  const double least_total = least > 0 ? least : most < 0 ? -most : 0;
  for (int i = 0; i < cell.count; ++i) {
    const auto [lowest, highest] = range_of(cell.share[i]);
    if (std::max(-lowest, highest) < cell.edge_tolerance * least_total) cell.share[i].setZero();
  }
}

/// Sets the rows that contain a triangle's projection, including the tolerance around it; all rows
/// where it reaches beyond the horizon.
void bound_rows(RayCells::Cell& cell, const rig::Rig& rig, const Vector3d& eye,
                const Matrix3d& pixel_from_world_ray) {
  constexpr double kEverywhere = std::numeric_limits<double>::infinity();
  cell.first_row = -kEverywhere;
  cell.last_row = kEverywhere;
  if (cell.count != 3) return;
  double first = kEverywhere, last = -kEverywhere, rounding = 0;
  const double scale = pixel_from_world_ray.row(1).norm();
  int in_front = 0;
  std::array<Vector3d, 3> corners;
  for (std::size_t i = 0; i < 3; ++i) corners[i] = rig.cameras[cell.camera[i]].pose.position;
  const Vector3d middle = corners[0] + ((corners[1] - corners[0]) + (corners[2] - corners[0])) / 3;
  for (const Vector3d& corner : corners) {
    // Weights down to -tolerance enlarge the triangle by 3 tolerances.
    const Vector3d to_corner = (corner - eye) + 4 * cell.edge_tolerance * (corner - middle);
    const Vector3d pixel = pixel_from_world_ray * to_corner;
    if (std::abs(pixel.z()) <= 1e-9 * to_corner.norm()) return;
    in_front += pixel.z() > 0 ? 1 : 0;
    const double row = pixel.y() / pixel.z();
    first = std::min(first, row);
    last = std::max(last, row);
    rounding = std::max(
        rounding, 8 * kEpsilon * (scale + std::abs(row)) * to_corner.norm() / std::abs(pixel.z()));
  }
  if (in_front != 0 && in_front != 3) return;
  const double margin = 2 + rounding;
  cell.first_row = first - margin;
  cell.last_row = last + margin;
}

double at(const Vector3d& function, double x, double y) {
  return function.x() * x + (function.y() * y + function.z());
}

bool passes_through(const RayCells::Cell& cell, double x, double y) {
  const double total = at(cell.total, x, y);
  if (!(std::abs(total) > 0) || (cell.only_leaving && total < 0)) return false;
  const double sign = total > 0 ? 1 : -1;
  double sum = 0;
  for (int i = 0; i < cell.count; ++i) {
    const double share = sign * at(cell.share[i], x, y);
    if (share < -cell.edge_tolerance * std::abs(total)) return false;
    sum += std::max(0.0, share);
  }
  return sum > 0;
}

/// Returns the products of the edges from the cell's first camera to its others; a missing camera
/// is placed far away.
std::array<double, 3> edge_products(const RayCells::Cell& cell, const rig::Rig& rig) {
  constexpr double kFar = 1e30;
  const auto edge = [&](std::size_t i) {
    return Vector3d(rig.cameras[cell.camera[i]].pose.position -
                    rig.cameras[cell.camera[0]].pose.position);
  };
  if (cell.count == 1) return {kFar, 0, kFar};
  if (cell.count == 2) return {edge(1).squaredNorm(), 0, kFar};
  return {edge(1).squaredNorm(), edge(1).dot(edge(2)), edge(2).squaredNorm()};
}

/// Cuts [low, high] to where slope * x + constant >= 0.
void keep_non_negative(double slope, double constant, double& low, double& high) {
  if (slope > 0) {
    low = std::max(low, -constant / slope);
  } else if (slope < 0) {
    high = std::min(high, -constant / slope);
  } else if (!(constant >= 0)) {
    high = -std::numeric_limits<double>::infinity();
  }
}

/// Sets the cell's pixels of a row to `mark`, on the side of the array's plane where `sign` * total
/// > 0.
void paint(const RayCells::Cell& cell, int mark, double sign, int y, int width,
           std::vector<int>& row) {
  const double centre_y = y + 0.5;
  double low = 0.5, high = width - 0.5;
  keep_non_negative(sign * cell.total.x(), sign * (cell.total.y() * centre_y + cell.total.z()), low,
                    high);
  for (int i = 0; i < cell.count; ++i) {
    const Vector3d edge = sign * (cell.share[i] + cell.edge_tolerance * cell.total);
    keep_non_negative(edge.x(), edge.y() * centre_y + edge.z(), low, high);
  }
  if (!(low <= high + 2) || low > width || high < 0) return;
  // The bounds are rounded; the predicate itself decides about the pixels next to them.
  int begin = std::max(0, static_cast<int>(std::floor(low - 0.5)) - 1);
  int end = std::min(width, static_cast<int>(std::ceil(high + 0.5)) + 1);
  const auto inside = [&](int x) {
    return sign * at(cell.total, x + 0.5, centre_y) > 0 && passes_through(cell, x + 0.5, centre_y);
  };
  while (begin < end && !inside(begin)) ++begin;
  while (begin < end && !inside(end - 1)) --end;
  std::fill(row.begin() + begin, row.begin() + std::max(begin, end), mark);
}

}  // namespace

Matrix3d world_ray_from_pixel(const VirtualCamera& view) {
  const schemas::Intrinsics& k = view.intrinsics;
  Matrix3d camera_ray_from_pixel;
  camera_ray_from_pixel << 1 / k.fx, 0, -k.cx / k.fx,  //
      0, -1 / k.fy, k.cy / k.fy,                       //
      0, 0, -1;
  return view.pose.world_from_camera_rotation * camera_ray_from_pixel;
}

RayCells::RayCells(const VirtualCamera& view, const rig::Rig& rig, const rig::Topology& topology) {
  const Matrix3d ray_from_pixel = world_ray_from_pixel(view);
  const Matrix3d pixel_from_ray = ray_from_pixel.inverse();
  cells_.reserve(topology.cells.size());
  for (const rig::Topology::Cell& indices : topology.cells) {
    cells_.push_back(make_cell(indices, topology, rig, view.pose.position, ray_from_pixel));
    cells_.back().only_leaving = topology.outwards;
    cells_.back().edge_products = edge_products(cells_.back(), rig);
    cells_.back().edge_tolerance = edge_tolerance(cells_.back(), rig, view.pose.position);
    drop_shares_below_tolerance(cells_.back(), view);
    bound_rows(cells_.back(), rig, view.pose.position, pixel_from_ray);
  }
}

RayCells::Crossing RayCells::nearest(const Crossing& crossing) const {
  const auto& [to_second, between, to_third] = cells_[crossing.cell].edge_products;
  const auto& w = crossing.weight;
  // |P - C1|^2 - |P - Ci|^2 is linear in the weights.
  const double second = 2 * (w[1] * to_second + w[2] * between) - to_second;
  const double third = 2 * (w[1] * between + w[2] * to_third) - to_third;
  Crossing nearest{crossing.cell, {}};
  nearest.weight[second <= 0 && third <= 0 ? 0 : second >= third ? 1 : 2] = 1;
  return nearest;
}

std::optional<RayCells::Crossing> RayCells::locate(double x, double y) const {
  for (std::size_t index = 0; index < cells_.size(); ++index) {
    if (passes_through(cells_[index], x, y)) return crossing_in_cell(static_cast<int>(index), x, y);
  }
  return std::nullopt;
}

RayCells::Crossing RayCells::crossing_in_cell(int index, double x, double y) const {
  const Cell& cell = cells_[index];
  Crossing crossing;
  crossing.cell = index;
  const double sign = at(cell.total, x, y) > 0 ? 1 : -1;
  double sum = 0;
  for (int i = 0; i < cell.count; ++i) {
    crossing.weight[i] = std::max(0.0, sign * at(cell.share[i], x, y));
    sum += crossing.weight[i];
  }
  for (double& weight : crossing.weight) weight /= sum;
  return crossing;
}

void RayCells::row_spans(int y, int width, std::vector<int>& scratch,
                         std::vector<Span>& spans) const {
  scratch.assign(width, -1);
  for (std::size_t i = cells_.size(); i-- > 0;) {  // the lowest index is painted last and wins
    const Cell& cell = cells_[i];
    if (y < cell.first_row || y > cell.last_row) continue;
    paint(cell, static_cast<int>(2 * i), 1, y, width, scratch);
    if (!cell.only_leaving) paint(cell, static_cast<int>(2 * i + 1), -1, y, width, scratch);
  }
  spans.clear();
  for (auto at = scratch.begin(); at != scratch.end();) {
    const int mark = *at;
    const auto end = std::find_if(at, scratch.end(), [&](int other) { return other != mark; });
    if (mark >= 0) {
      spans.push_back({static_cast<int>(at - scratch.begin()),
                       static_cast<int>(end - scratch.begin()), mark / 2});
    }
    at = end;
  }
}

}  // namespace raystage::render
