// SPDX-License-Identifier: Apache-2.0
// Finds the cell of nodes that each ray of a view crosses on a slab's camera plane (thesis appendix
// A). Numerators and the denominator are linear in the pixel, so that each row divides into
// monotone runs. Output: runs per row. Cost: cells per row.

#include "render/slabs/slab_rays.h"

#include <algorithm>
#include <cmath>
#include <limits>

#include "render/common/ray_cells.h"

namespace raystage::render {
namespace {

using Eigen::Matrix3d;
using Eigen::Vector3d;

/// Tolerance in nodes outside the grid, for views on its own edge.
constexpr double kEdgeTolerance = 1e-9;

double at(const Vector3d& function, double x, double y) {
  return function.x() * x + (function.y() * y + function.z());
}

}  // namespace

SlabRays::SlabRays(const VirtualCamera& view, const Slab& slab)
    : columns_(slab.columns), rows_(slab.rows) {
  const Matrix3d world_from_pixel = world_ray_from_pixel(view);
  const Matrix3d slab_from_world = slab.pose.world_from_camera_rotation.transpose();
  const Matrix3d rays = slab_from_world * world_from_pixel;
  const Vector3d eye = slab_from_world * (view.pose.position - slab.pose.position);
  const auto row_of = [&](int i) { return Vector3d(rays.row(i).transpose()); };
  across_ = -row_of(2);
  if (columns_ > 1) column_times_ = (eye.x() * across_ + eye.z() * row_of(0)) / slab.column_spacing;
  if (rows_ > 1) row_times_ = -(eye.y() * across_ + eye.z() * row_of(1)) / slab.row_spacing;

  for (const double side : {1.0, -1.0}) {
    Conditions conditions;
    for (const auto& [times, count] :
         {std::pair{column_times_, columns_}, std::pair{row_times_, rows_}}) {
      if (count == 1) continue;
      conditions.emplace_back(side * (times + kEdgeTolerance * across_));
      conditions.emplace_back(side * ((count - 1 + kEdgeTolerance) * across_ - times));
    }
    // A single camera also has rays along its plane.
    if (slab.nodes() > 1) conditions.emplace_back(side * across_);
    for (const Vector3d& rival : slab.competing_axes) {
      conditions.emplace_back(world_from_pixel.transpose() *
                              (slab.pose.viewing_direction() - rival));
    }
    sides_.push_back(std::move(conditions));
    if (slab.nodes() == 1) break;
  }
}

bool SlabRays::contains_ray(double x, double y) const {
  return std::ranges::any_of(sides_, [&](const Conditions& conditions) {
    return (columns_ * rows_ == 1 || at(across_, x, y) != 0) &&
           std::ranges::all_of(conditions,
                               [&](const Vector3d& function) { return at(function, x, y) >= 0; });
  });
}

SlabRays::Crossing SlabRays::crossing(double x, double y) const {
  const double across = at(across_, x, y);
  const auto place = [&](const Vector3d& times, int count) {
    return count == 1 ? 0.0 : std::clamp(at(times, x, y) / across, 0.0, count - 1.0);
  };
  return {place(column_times_, columns_), place(row_times_, rows_)};
}

void SlabRays::runs_of_row(int y, int width, std::vector<Run>& runs) const {
  runs.clear();
  for (const Conditions& conditions : sides_) add_runs(conditions, y, width, runs);
}

void SlabRays::add_runs(const Conditions& conditions, int y, int width,
                        std::vector<Run>& runs) const {
  const double centre_y = y + 0.5;
  double low = 0.5, high = width - 0.5;
  for (const Vector3d& function : conditions) {
    const double constant = function.y() * centre_y + function.z();
    if (function.x() > 0) {
      low = std::max(low, -constant / function.x());
    } else if (function.x() < 0) {
      high = std::min(high, -constant / function.x());
    } else if (!(constant >= 0)) {
      return;
    }
  }
  if (!(low <= high + 2)) return;
  // The bounds are rounded; the conditions themselves decide about the pixels next to them.
  int begin = std::max(0, static_cast<int>(std::floor(low - 0.5)) - 1);
  int end = std::min(width, static_cast<int>(std::ceil(high + 0.5)) + 1);
  const auto inside = [&](int x) {
    return (columns_ * rows_ == 1 || at(across_, x + 0.5, centre_y) != 0) &&
           std::ranges::all_of(conditions, [&](const Vector3d& function) {
             return at(function, x + 0.5, centre_y) >= 0;
           });
  };
  while (begin < end && !inside(begin)) ++begin;
  while (begin < end && !inside(end - 1)) --end;
  if (begin >= end) return;

  // Column and row are monotone in the interval: cells change where they reach a node.
  std::vector<int> starts{begin};
  for (const auto& [times, count] :
       {std::pair{&column_times_, columns_}, std::pair{&row_times_, rows_}}) {
    for (int node = 1; node + 1 < count; ++node) {
      const Vector3d to_node = *times - node * across_;
      const double where = -(to_node.y() * centre_y + to_node.z()) / to_node.x();
      if (!(where > begin && where < end)) continue;
      const int start = static_cast<int>(std::ceil(where - 0.5));
      if (start > begin && start < end) starts.push_back(start);
    }
  }
  std::ranges::sort(starts);
  starts.erase(std::unique(starts.begin(), starts.end()), starts.end());
  for (std::size_t i = 0; i < starts.size(); ++i) {
    const int last = i + 1 < starts.size() ? starts[i + 1] : end;
    const Crossing middle = crossing((starts[i] + last) / 2.0, centre_y);
    const auto cell = [](double place, int count) {
      return std::clamp(static_cast<int>(place), 0, std::max(0, count - 2));
    };
    runs.push_back({starts[i], last, cell(middle.column, columns_), cell(middle.row, rows_)});
  }
}

}  // namespace raystage::render
