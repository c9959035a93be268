// SPDX-License-Identifier: Apache-2.0
// Fits the slabs of a light field frame's cameras (slab.cpp), finds the sources of their nodes
// (node_sources.cpp) and caches both by options and present cameras. Also returns the focal plane
// of each slab. Cost: that of fit_slabs() and node_sources(), once per set of present cameras.
#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <numbers>
#include <optional>

#include "render/common/plane_projection.h"
#include "render/slabs/slabs.h"

namespace raystage::render {
namespace {

RigSlabs make_slabs(const LightFieldFrame& instant, const SlabOptions& settings) {
  const rig::Rig& rig = *instant.rig;
  const std::vector<int>& complete = instant.included_cameras;
  RigSlabs made;
  made.slabs = fit_slabs(rig, complete, instant.complete->normal, settings);
  for (const Slab& slab : made.slabs) {
    if (slab.cameras == complete) {
      made.nodes.push_back(node_sources(slab, rig, *instant.present, *instant.complete));
      continue;
    }
    const rig::Topology all = rig::make_topology(rig, slab.cameras);
    std::vector<int> there;
    std::ranges::copy_if(slab.cameras, std::back_inserter(there),
                         [&](int camera) { return instant.is_present(camera); });
    std::optional<rig::Topology> some;
    if (there != slab.cameras)
      some = there.empty() ? rig::Topology{} : rig::make_topology(rig, there);
    made.nodes.push_back(node_sources(slab, rig, some ? *some : all, all));
  }
  return made;
}

}  // namespace

Eigen::Vector4d slab_focal_plane(const Slab& slab, const ViewRequest& request) {
  const Eigen::Vector4d& plane = request.focal_plane;
  const double normal = plane.head<3>().norm();
  if (slab.competing_axes.empty() || normal == 0) return plane;
  const Eigen::Vector3d middle = request.instant.rig->centre();
  const double distance = std::abs(signed_plane_distance(plane, middle));
  const Eigen::Vector3d ahead = slab.pose.viewing_direction();
  return {ahead.x(), ahead.y(), ahead.z(), -(ahead.dot(middle) + distance)};
}

SlabInterpolation slab_interpolation(const MethodOptions& options) {
  const std::string& name = options.text("interpolation");
  if (name == "nearest") return SlabInterpolation::kNearest;
  return name == "bilinear_st" ? SlabInterpolation::kBilinearNodes
                               : SlabInterpolation::kQuadrilinear;
}

std::shared_ptr<const RigSlabs> rig_slabs(const ViewRequest& request) {
  const MethodOptions& options = request.options;
  SlabOptions settings;
  settings.layout =
      options.text("layout") == "box" ? SlabOptions::Layout::kBox : SlabOptions::Layout::kSingle;
  settings.columns = options.integer("columns");
  settings.rows = options.integer("rows");
  settings.uv_scale = options.number("uv_scale");
  settings.max_fov = options.number("max_fov") * std::numbers::pi / 180;
  std::string present;
  for (const int camera : request.instant.included_cameras) {
    present += request.instant.is_present(camera) ? '1' : '0';
  }
  const std::string key =
      fmt::format("slabs of the rig\n{} {} {} {:a} {:a}\n{}\n{}", options.text("layout"),
                  settings.columns, settings.rows, settings.uv_scale, settings.max_fov,
                  fmt::join(request.instant.included_cameras, " "), present);
  return request.result_cache.get<RigSlabs>(key, [&](std::size_t& bytes) {
    auto made = std::make_shared<const RigSlabs>(make_slabs(request.instant, settings));
    for (const auto& nodes : made->nodes) bytes += nodes.size() * sizeof(NodeSources);
    return made;
  });
}

}  // namespace raystage::render
