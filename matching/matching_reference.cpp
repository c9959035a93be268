// SPDX-License-Identifier: Apache-2.0
// References of semi_global_match() (Hirschmueller 2008, eq. 12) and box_match(), bit-exact, on the
// complete cost volume. Output: plane and cost per pixel. Cost: pixels x planes x 8 paths.
#include <algorithm>
#include <cstdlib>

#include "matching/matching.h"

namespace raystage::matching {
namespace {

/// The complete cost volume: costs per pixel and plane.
struct Volume {
  Volume(const CostVolume& of, const FillCosts& fill) : shape(of) {
    const auto stride = static_cast<std::size_t>(plane_stride(of.planes));
    std::vector<std::uint8_t> row(stride * of.width);
    for (int y = 0; y < of.height; ++y) {
      fill(y, row);
      for (int x = 0; x < of.width; ++x) {
        for (int plane = 0; plane < of.planes; ++plane) {
          cost.push_back(row[static_cast<std::size_t>(x) * stride + plane]);
        }
      }
    }
  }
  bool contains(int x, int y) const {
    return x >= 0 && y >= 0 && x < shape.width && y < shape.height;
  }
  std::size_t pixel(int x, int y) const { return static_cast<std::size_t>(y) * shape.width + x; }
  std::size_t at(int x, int y, int plane) const {
    return pixel(x, y) * static_cast<std::size_t>(shape.planes) + plane;
  }

  CostVolume shape;
  std::vector<std::uint8_t> cost;
};

PlaneMap choose(const Volume& volume, const std::vector<int>& sums, bool subplane_refinement) {
  PlaneMap map(volume.shape.width, volume.shape.height);
  for (int y = 0; y < map.height; ++y) {
    for (int x = 0; x < map.width; ++x) {
      int best = 0;
      for (int plane = 1; plane < volume.shape.planes; ++plane) {
        if (sums[volume.at(x, y, plane)] < sums[volume.at(x, y, best)]) best = plane;
      }
      const std::size_t at = volume.at(x, y, best);
      const bool between = subplane_refinement && best > 0 && best + 1 < volume.shape.planes;
      map.plane[volume.pixel(x, y)] =
          static_cast<float>(best) +
          (between ? parabola_vertex(sums[at - 1], sums[at], sums[at + 1]) : 0);
      map.cost[volume.pixel(x, y)] = volume.cost[at];
    }
  }
  return map;
}

/// Adds to `sums` the path costs of Hirschmueller's eq. 12 for paths from (-dx, -dy).
void add_paths(const Volume& volume, const SemiGlobalOptions& options, int dx, int dy,
               std::vector<int>& sums) {
  const auto [width, height, planes] = volume.shape;
  const std::vector<std::uint16_t> p2_table = p2_by_guide_step(options);
  std::vector<int> path(sums.size());
  for (int i = 0; i < height; ++i) {
    for (int j = 0; j < width; ++j) {
      const int x = dx < 0 ? width - 1 - j : j, y = dy < 0 ? height - 1 - i : i;
      const int px = x - dx, py = y - dy;
      const bool enters = !volume.contains(px, py);
      int p2 = options.p2, least = 0;
      if (!enters) {
        if (!options.guide.empty()) {
          p2 = p2_table[std::abs(options.guide[volume.pixel(x, y)] -
                                 options.guide[volume.pixel(px, py)])];
        }
        const auto first = path.begin() + static_cast<std::ptrdiff_t>(volume.at(px, py, 0));
        least = *std::min_element(first, first + planes);
      }
      for (int plane = 0; plane < planes; ++plane) {
        int before = 0;
        if (!enters) {
          const auto from = [&](int other, int penalty) {
            return path[volume.at(px, py, other)] + penalty;
          };
          before = std::min(from(plane, 0), least + p2);
          if (plane > 0) before = std::min(before, from(plane - 1, options.p1));
          if (plane + 1 < planes) before = std::min(before, from(plane + 1, options.p1));
        }
        const std::size_t at = volume.at(x, y, plane);
        path[at] = volume.cost[at] + before - least;
        sums[at] += path[at];
      }
    }
  }
}

}  // namespace

PlaneMap semi_global_match_reference(const CostVolume& shape, const FillCosts& fill,
                                     const SemiGlobalOptions& options) {
  const Volume volume(shape, fill);
  std::vector<int> sums(volume.cost.size());
  for (int dy = -1; dy <= 1; ++dy) {
    for (int dx = -1; dx <= 1; ++dx) {
      if (dx != 0 || dy != 0) add_paths(volume, options, dx, dy, sums);
    }
  }
  return choose(volume, sums, options.subplane_refinement);
}

PlaneMap box_match_reference(const CostVolume& shape, const FillCosts& fill, int radius,
                             bool subplane_refinement) {
  const Volume volume(shape, fill);
  std::vector<int> sums(volume.cost.size());
  for (int y = 0; y < shape.height; ++y) {
    for (int x = 0; x < shape.width; ++x) {
      for (int plane = 0; plane < shape.planes; ++plane) {
        for (int j = -radius; j <= radius; ++j) {
          for (int i = -radius; i <= radius; ++i) {
            if (!volume.contains(x + i, y + j)) continue;
            sums[volume.at(x, y, plane)] += volume.cost[volume.at(x + i, y + j, plane)];
          }
        }
      }
    }
  }
  return choose(volume, sums, subplane_refinement);
}

}  // namespace raystage::matching
