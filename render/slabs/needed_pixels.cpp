// SPDX-License-Identifier: Apache-2.0
// Counts the source pixels that a view of slabs depends on: marks the bilinear taps of each ray in
// the frames of the cameras of its nodes, where the ray meets the focal plane (mark_run()). Output:
// number of distinct pixels. Cost: O(pixels x 4 nodes x up to 3 cameras).
#include "render/slabs/needed_pixels.h"

#include <algorithm>
#include <cmath>

#include "render/sampling/source_view.h"

namespace raystage::render {

NeededPixels::NeededPixels(const LightFieldFrame& instant)
    : instant_(instant), read_(instant.rig->cameras.size()) {}

void NeededPixels::mark(const SlabRays& rays, const SlabRays::Run& run, int y, bool nearest,
                        const std::array<const NodeSources*, 4>& nodes,
                        const PlaneProjection& projection) {
  const auto counts = [&](std::size_t node, int x) {
    const SlabRays::Crossing crossing = rays.crossing(x + 0.5, y + 0.5);
    double right = std::clamp(crossing.column - run.column, 0.0, 1.0);
    double lower = std::clamp(crossing.row - run.row, 0.0, 1.0);
    if (nearest) {
      right = std::floor(right + 0.5);
      lower = std::floor(lower + 0.5);
    }
    return (node % 2 == 0 ? 1 - right : right) * (node < 2 ? 1 - lower : lower) > 0;
  };
  for (std::size_t node = 0; node < nodes.size(); ++node) {
    if (nodes[node] == nullptr) continue;
    for (int begin = run.begin; begin < run.end;) {
      int end = begin;
      while (end < run.end && counts(node, end)) ++end;
      if (end > begin) mark_node(*nodes[node], begin, end, y, projection);
      begin = end + 1;
    }
  }
}

void NeededPixels::mark_node(const NodeSources& node, int begin, int end, int y,
                             const PlaneProjection& projection) {
  for (int i = 0; i < node.count; ++i) {
    if (!(node.weight[i] > 0)) continue;
    const auto camera = static_cast<std::size_t>(node.camera[i]);
    const rig::Rig::Camera& source = instant_.rig->cameras[camera];
    std::vector<std::uint8_t>& read = read_[camera];
    read.resize(static_cast<std::size_t>(source.model.width()) * source.model.height());
    SourceView view = make_source_view(source.model, projection.ideal_from_pixel(source.pose));
    view.read_pixels = read.data();
    PixelRun run;
    run.begin = begin;
    run.end = end;
    run.y = y;
    run.count = 1;
    run.source[0] = &view;
    run.share[0] = run.total = {0, 0, 1};
    run.slope = {projection.slope().x(), projection.slope().y(), projection.slope().z()};
    run.distance = projection.distance();
    run.at_infinity = projection.at_infinity();
    mark_run(run);
  }
}

std::int64_t NeededPixels::count() const {
  std::int64_t needed = 0;
  for (const auto& pixels : read_) needed += std::count(pixels.begin(), pixels.end(), 1);
  return needed;
}

}  // namespace raystage::render
