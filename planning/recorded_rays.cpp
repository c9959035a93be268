// SPDX-License-Identifier: Apache-2.0
// Shares of a perspective view's rays, by areas (recorded_part.h) or by rays that are tested one by
// one, as the reference does.
#include "planning/recorded_rays.h"

#include <algorithm>
#include <set>
#include <vector>

#include "planning/ideal_view.h"
#include "planning/recorded_part.h"
#include "planning/seen_area.h"
#include "render/common/plane_projection.h"
#include "render/common/ray_cells.h"

namespace raystage::planning {
namespace {

using Eigen::Vector2d;
using render::RayCells;

/// Returns the share by testing rays on a grid of at most `columns` x `rows`.
double sampled_share(const render::VirtualCamera& view, const rig::Rig& rig, const RayCells& cells,
                     const render::PlaneProjection& projection, int columns, int rows) {
  std::vector<PlaneView> cameras;
  cameras.reserve(rig.cameras.size());
  for (const rig::Rig::Camera& camera : rig.cameras) cameras.emplace_back(projection, camera, 0);
  const auto is_recorded = [&](const Vector2d& pixel) {
    const auto crossing = cells.locate(pixel.x(), pixel.y());
    if (!crossing || !(projection.depth(pixel.x(), pixel.y()) > 0)) return false;
    const RayCells::Cell& cell = cells.cells()[crossing->cell];
    return std::any_of(cell.camera.begin(), cell.camera.begin() + cell.count, [&](int camera) {
      return std::ranges::min(cameras[camera].borders_at(pixel)) >= 0;
    });
  };
  long missing = 0;
  for (int y = 0; y < rows; ++y) {
    for (int x = 0; x < columns; ++x) {
      const Vector2d pixel((x + 0.5) * view.width / columns, (y + 0.5) * view.height / rows);
      missing += is_recorded(pixel) ? 0 : 1;
    }
  }
  return static_cast<double>(missing) / (static_cast<double>(columns) * rows);
}

}  // namespace
double unrecorded_share(const render::VirtualCamera& view, const rig::Rig& rig,
                        const rig::Topology& topology, const Eigen::Vector4d& plane) {
  return unrecorded_part({view}, rig, topology, plane);
}

bool is_recorded(const render::VirtualCamera& view, const rig::Rig& rig,
                 const rig::Topology& topology, const Eigen::Vector4d& plane, double share) {
  const double most_missing = 1 - share;
  constexpr double kBend = 5e-4;
  return unrecorded_part({view}, rig, topology, plane, {kBend, most_missing}) <=
         most_missing + 1e-12;
}

double unseen_share(const render::VirtualCamera& given, const rig::Rig& rig,
                    const rig::Topology& topology, const Eigen::Vector4d& plane) {
  const render::VirtualCamera view = ideal_view(given);
  const render::PlaneProjection projection(view, plane);
  if (!projection.at_infinity() && projection.distance() == 0) return 1;
  std::set<int> present;
  for (const rig::Topology::Cell& cell : topology.cells) {
    for (const int camera : cell) {
      if (camera >= 0) present.insert(camera);
    }
  }
  std::vector<PlaneView> cameras;
  for (const int camera : present) cameras.emplace_back(projection, rig.cameras[camera], 0);
  constexpr int kColumns = 65, kRows = 49;
  std::size_t last = 0;  // the camera that saw the ray before: it often sees the next one, too
  const auto is_seen = [&](const Vector2d& pixel) {
    if (!(projection.depth(pixel.x(), pixel.y()) > 0)) return false;
    for (std::size_t i = 0; i < cameras.size(); ++i) {
      const std::size_t camera = (last + i) % cameras.size();
      if (std::ranges::min(cameras[camera].borders_at(pixel)) < 0) continue;
      last = camera;
      return true;
    }
    return false;
  };
  // To the picture's borders, where views are the first to lack rays; by the trapezoidal rule.
  const auto weight = [](int i, int count) { return i == 0 || i == count - 1 ? 0.5 : 1.0; };
  double missing = 0;
  for (int y = 0; y < kRows; ++y) {
    for (int x = 0; x < kColumns; ++x) {
      const Vector2d pixel(x * view.width / (kColumns - 1.0), y * view.height / (kRows - 1.0));
      if (!is_seen(pixel)) missing += weight(x, kColumns) * weight(y, kRows);
    }
  }
  return missing / ((kColumns - 1.0) * (kRows - 1.0));
}

double unrecorded_share_reference(const render::VirtualCamera& given, const rig::Rig& rig,
                                  const rig::Topology& topology, const Eigen::Vector4d& plane) {
  const render::VirtualCamera view = ideal_view(given);
  const render::PlaneProjection projection(view, plane);
  if (!projection.at_infinity() && projection.distance() == 0) return 1;
  return sampled_share(view, rig, RayCells(view, rig, topology), projection, view.width,
                       view.height);
}

}  // namespace raystage::planning
