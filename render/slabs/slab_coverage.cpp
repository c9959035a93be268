// SPDX-License-Identifier: Apache-2.0
// Measures the cameras behind each visible pixel of a view of slabs, in double. Adds the cameras of
// the up to four nodes around the ray's crossing (RayCoverage). A camera's weight is the node's
// weight times its weight in the node times the visibility of the ray's point. Input: alpha and z
// (metres) of the view. Output: effective number of cameras, and distance of the nearest one from
// the ray, metres. Cost: O(pixels x 4 nodes x up to 3 cameras).
#include "render/slabs/slab_coverage.h"

#include <algorithm>
#include <array>
#include <cmath>

#include "base/parallel.h"
#include "render/common/ray_cells.h"
#include "render/sampling/direction_visibility.h"
#include "render/sampling/source_view.h"
#include "render/slabs/slab_rays.h"

namespace raystage::render {
namespace {

using Eigen::Vector3d;

constexpr std::size_t kMax = 4 * 3;  // nodes times cameras per node

/// The point on a ray relative to a position, divided by its depth: finite at infinity.
struct ViewPoint {
  Vector3d eye, direction;
  double inverse_depth;
  Vector3d seen_from(const Vector3d& place) const {
    return direction - (place - eye) * inverse_depth;
  }
};

/// Returns the visibility of the point in a node's image, 0 to 1.
double within_image(const Slab& slab, const Vector3d& in_node) {
  if (!(in_node.z() < 0)) return 0;
  const schemas::Intrinsics& k = slab.image;
  const double u = k.fx * in_node.x() / -in_node.z() + k.cx;
  const double v = k.fy * in_node.y() / in_node.z() + k.cy;
  return std::clamp(std::min({u, slab.width - u, v, slab.height - v}) * kBorderFade, 0.0, 1.0);
}

class SlabCoverage {
 public:
  SlabCoverage(const ViewRequest& request, const Slab& slab, const std::vector<NodeSources>& nodes)
      : request_(request),
        slab_(slab),
        nodes_(nodes),
        nearest_(slab_interpolation(request.options) == SlabInterpolation::kNearest),
        rays_(request.view, slab) {}

  bool contains_ray(double x, double y) const {
    return slab_.width > 0 && rays_.contains_ray(x, y);
  }

  RayCoverage measure(double x, double y, const ViewPoint& point) const {
    const SlabRays::Crossing crossing = rays_.crossing(x, y);
    const int left = std::min(static_cast<int>(crossing.column), std::max(0, slab_.columns - 2));
    const int upper = std::min(static_cast<int>(crossing.row), std::max(0, slab_.rows - 2));
    const double right_part = part_of(crossing.column - left);
    const double lower_part = part_of(crossing.row - upper);
    std::array<RayCamera, kMax> cameras;
    std::size_t count = 0;
    for (int row = upper; row < std::min(upper + 2, slab_.rows); ++row) {
      for (int column = left; column < std::min(left + 2, slab_.columns); ++column) {
        const double weight = (column == left ? 1 - right_part : right_part) *
                              (row == upper ? 1 - lower_part : lower_part);
        if (weight > 0) add_node(column, row, weight, point, cameras, count);
      }
    }
    return measure_ray_coverage(std::span(cameras).first(count), request_, point.direction);
  }

 private:
  double part_of(double place) const { return nearest_ ? (place >= 0.5 ? 1.0 : 0.0) : place; }

  void add_node(int column, int row, double weight, const ViewPoint& point,
                std::array<RayCamera, kMax>& cameras, std::size_t& count) const {
    const Vector3d in_node = slab_.pose.world_from_camera_rotation.transpose() *
                             point.seen_from(slab_.node_position(column, row));
    const double held = within_image(slab_, in_node);
    if (!(held > 0)) return;
    const NodeSources& sources = nodes_[row * slab_.columns + column];
    for (int i = 0; i < sources.count; ++i) {
      const int index = sources.camera[i];
      const rig::Rig::Camera& camera = request_.instant.rig->cameras[index];
      Eigen::Vector2d pixel;
      const double seen = direction_visibility(camera.model,
                                               camera.pose.world_from_camera_rotation.transpose() *
                                                   point.seen_from(camera.pose.position),
                                               pixel);
      const auto known = std::find_if(cameras.begin(), cameras.begin() + count,
                                      [&](const RayCamera& c) { return c.camera == index; });
      if (known == cameras.begin() + count) cameras[count++] = {index, 0};
      known->weight += weight * sources.weight[i] * std::min(seen, held);
    }
  }

  const ViewRequest& request_;
  const Slab& slab_;
  const std::vector<NodeSources>& nodes_;
  bool nearest_;
  SlabRays rays_;
};

}  // namespace

RayCoverage measure_ray_coverage(std::span<const RayCamera> cameras, const ViewRequest& request,
                                 const Vector3d& ray) {
  RayCoverage coverage;
  for (const RayCamera& behind : cameras) {
    const rig::Pose& pose = request.instant.rig->cameras[behind.camera].pose;
    coverage.add(behind.weight, ray, pose.position - request.view.pose.position);
  }
  return coverage;
}

void measure_slab_coverage(const ViewRequest& request, const RigSlabs& slabs, RenderedView& image) {
  clear_coverage_measures(image);
  const VirtualCamera& view = request.view;
  const Eigen::Matrix3d ray_from_pixel = world_ray_from_pixel(view);
  std::vector<SlabCoverage> parts;
  for (std::size_t i = 0; i < slabs.slabs.size(); ++i) {
    parts.emplace_back(request, slabs.slabs[i], slabs.nodes[i]);
  }
  raystage::parallel_for(0, view.height, [&](int row) {
    for (int column = 0; column < view.width; ++column) {
      const std::size_t at = image.index(column, row);
      if (!(image.rgba[at * 4 + 3] > 0)) continue;
      const double x = column + 0.5, y = row + 0.5;
      const auto part =
          std::ranges::find_if(parts, [&](const SlabCoverage& p) { return p.contains_ray(x, y); });
      if (part == parts.end()) continue;
      const RayCoverage coverage =
          part->measure(x, y,
                        {view.pose.position, ray_from_pixel * Vector3d(x, y, 1),
                         1 / static_cast<double>(image.z[at])});
      image.cameras[at] = coverage.cameras();
      image.nearest_ray[at] = coverage.nearest_ray();
    }
  });
}

}  // namespace raystage::render
