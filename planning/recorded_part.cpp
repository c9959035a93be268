// SPDX-License-Identifier: Apache-2.0
// Measures which rays of a view were recorded, as parts of the picture (thesis 4.1.2 and 5.2). The
// rays of a cell fill a convex polygon. Each of its cameras sees the focal plane in a part of the
// picture that four borders bound, which are linear in the pixel without lens distortion. The union
// of the parts of up to three cameras is the sum of their intersections with alternating signs,
// each of which is convex. With distortion, for fisheyes and for a sphere in focus, a polygon is
// divided until its borders are nearly straight. Cost: O(cells), 20 to 100 microseconds for 64
// cameras.
#include "planning/recorded_part.h"

#include <algorithm>
#include <cmath>
#include <span>
#include <utility>

#include "render/common/ray_cells.h"

namespace raystage::planning {
namespace {

using Eigen::Vector2d;
using Eigen::Vector3d;
using render::RayCells;

/// Returns whether the array folds over itself as seen from `eye`: rays then cross several cells,
/// of which the first counts.
bool is_folded(const rig::Rig& rig, const rig::Topology& topology, const Vector3d& eye) {
  // A line leaves a closed surface through one cell, from wherever it is seen.
  if (topology.kind != rig::Topology::Kind::kTriangles || topology.outwards) return false;
  bool left = false, right = false;
  for (const rig::Topology::Cell& cell : topology.cells) {
    std::array<Vector3d, 3> to;
    for (std::size_t i = 0; i < 3; ++i) to[i] = rig.cameras[cell[i]].pose.position - eye;
    const double side = to[0].dot((to[1] - to[0]).cross(to[2] - to[0]));
    (side > 0 ? right : left) = true;
  }
  return left && right;
}

/// The part of the view whose rays pass through a cell from one side of it.
struct Region {
  const RayCells::Cell* cell = nullptr;
  std::vector<Vector3d> lines;  ///< the part is where none is negative
  Polygon polygon;              ///< the part within the picture
  Eigen::AlignedBox2d box;      ///< around it
};

std::vector<Region> regions_of(const RayCells& cells, const Polygon& picture) {
  std::vector<Region> regions;
  for (const RayCells::Cell& cell : cells.cells()) {
    for (const double sign : {1.0, -1.0}) {
      if (sign < 0 && cell.only_leaving) continue;
      Region region;
      region.cell = &cell;
      region.lines.emplace_back(sign * cell.total);
      for (int i = 0; i < cell.count && cell.count > 1; ++i) {
        region.lines.emplace_back(sign * cell.share[i]);
      }
      region.polygon = picture;
      for (const Vector3d& line : region.lines) region.polygon = region.polygon.clipped(line);
      if (region.polygon.is_empty()) continue;
      region.box = region.polygon.box();
      regions.push_back(std::move(region));
    }
  }
  return regions;
}

/// Returns the parts of a region that no region before it covers.
std::vector<Polygon> uncovered_parts(std::span<const Region> before, const Region& region) {
  std::vector<Polygon> parts{region.polygon};
  for (const Region& other : before) {
    if (!other.box.intersects(region.box)) continue;
    std::vector<Polygon> outside;
    for (Polygon part : parts) {
      for (const Vector3d& line : other.lines) {
        // Not where the line is 0 everywhere, as on the border of two cells.
        if (part.reaches_beyond(line)) outside.push_back(part.clipped(-line));
        part = part.clipped(line);
      }
    }
    parts = std::move(outside);
  }
  return parts;
}

}  // namespace

double unrecorded_part(const RayBundle& rays, const rig::Rig& rig, const rig::Topology& topology,
                       const Eigen::Vector4d& plane, const Precision& precision) {
  const render::VirtualCamera view = ideal_view(rays.view);
  const render::PlaneProjection projection(view, plane);
  if (!projection.at_infinity() && projection.distance() == 0) return 1;
  Polygon picture = rays.picture;
  if (picture.is_empty()) {
    for (const auto& [x, y] :
         {std::pair{0, 0}, {view.width, 0}, {view.width, view.height}, {0, view.height}}) {
      picture.add(Vector2d(x, y));
    }
  }
  const Measure& measure = rays.measure;
  const double total = picture.measured(measure);
  if (!projection.at_infinity()) {  // the plane is in front of the view where its depth is positive
    const double sign = projection.distance() > 0 ? 1 : -1;
    picture = picture.clipped(sign * projection.slope());
  }
  const RayCells cells(view, rig, topology);
  const std::vector<Region> regions = regions_of(cells, picture);
  double of_regions = 0;
  for (const Region& region : regions) of_regions += region.polygon.measured(measure);
  // All rays of a view on the border of two cells are in both.
  constexpr double kAreaRounding = 1e-9;
  const bool overlap =
      is_folded(rig, topology, view.pose.position) || of_regions > total * (1 + kAreaRounding);
  // Of regions that overlap the areas are only known after subtraction.
  double missing = overlap ? total : total - of_regions;
  std::vector<std::optional<PlaneView>> cameras(rig.cameras.size());
  for (std::size_t r = 0; r < regions.size(); ++r) {
    if (!overlap && missing > precision.enough * total) break;
    const RayCells::Cell& cell = *regions[r].cell;
    CellCameras sources(measure);
    for (int i = 0; i < cell.count; ++i) {
      std::optional<PlaneView>& camera = cameras[cell.camera[i]];
      if (!camera) {
        camera.emplace(projection, rig.cameras[cell.camera[i]], precision.bend,
                       rays.sphere ? &*rays.sphere : nullptr);
      }
      sources.add(*camera);
    }
    const auto seen_in = [&](const Polygon& polygon) {
      double seen = 0;
      for (std::size_t i = 2; i < polygon.size(); ++i) {
        seen += sources.seen_area({polygon[0], polygon[i - 1], polygon[i]});
      }
      return seen;
    };
    if (!overlap) {
      missing += regions[r].polygon.measured(measure) - seen_in(regions[r].polygon);
      continue;
    }
    for (const Polygon& part : uncovered_parts(std::span(regions).first(r), regions[r])) {
      missing -= seen_in(part);
    }
  }
  constexpr double kRounding = 1e-9;
  const double share = missing / total;
  return share < kRounding ? 0 : std::min(share, 1.0);
}

}  // namespace raystage::planning
