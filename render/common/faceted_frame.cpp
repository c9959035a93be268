// SPDX-License-Identifier: Apache-2.0
#include "render/common/faceted_frame.h"

#include <algorithm>

namespace raystage::render {
namespace {

std::vector<int> of_facets(const std::vector<int>& of_camera,
                           const std::vector<int>& camera_of_facet) {
  std::vector<int> of_facet;
  if (of_camera.empty()) return of_facet;
  for (const int camera : camera_of_facet) of_facet.push_back(of_camera[camera]);
  return of_facet;
}

/// Returns the facets of cameras of a topology, one cell each: methods that use facets ask a
/// topology only for its cameras.
std::shared_ptr<const rig::Topology> facets_in(const rig::Topology& topology,
                                               const std::vector<int>& camera_of_facet) {
  auto facets = std::make_shared<rig::Topology>(topology);
  facets->cells.clear();
  for (std::size_t i = 0; i < camera_of_facet.size(); ++i) {
    const bool is_in = std::ranges::any_of(topology.cells, [&](const rig::Topology::Cell& cell) {
      return std::ranges::find(cell, camera_of_facet[i]) != cell.end();
    });
    if (is_in) facets->cells.push_back({static_cast<int>(i), -1, -1});
  }
  return facets;
}

}  // namespace

FacetedFrame::FacetedFrame(const LightFieldFrame& whole)
    : whole_(whole), facets_(rig::pinhole_facets(*whole.rig)) {
  if (!facets_) return;
  const std::vector<int>& cameras = facets_->camera_of_facet;
  faceted_ = whole;
  faceted_.rig = &facets_->rig;
  faceted_.camera_of_take = cameras;
  faceted_.cache = &cache_.emplace(whole.cache->renumbered(cameras));
  if (whole.opaque != nullptr) {
    faceted_.opaque = &opaque_.emplace(whole.opaque->renumbered(cameras));
  }
  faceted_.frame_of_camera = of_facets(whole.frame_of_camera, cameras);
  for (std::vector<int>& frames : faceted_.adjacent_frames) frames = of_facets(frames, cameras);
  faceted_.rank_of_camera = of_facets(whole.rank_of_camera, cameras);
  faceted_.included_cameras.clear();
  for (std::size_t i = 0; i < cameras.size(); ++i) {
    if (std::ranges::find(whole.included_cameras, cameras[i]) != whole.included_cameras.end()) {
      faceted_.included_cameras.push_back(static_cast<int>(i));
    }
  }
  if (whole.present) faceted_.present = facets_in(*whole.present, cameras);
  if (whole.complete) {
    faceted_.complete =
        whole.complete == whole.present ? faceted_.present : facets_in(*whole.complete, cameras);
  }
}

RaySurface kept_with(std::shared_ptr<const FacetedFrame> facets, RaySurface surface) {
  return [facets = std::move(facets), surface = std::move(surface)](
             std::span<const WorldRay> rays, std::span<double> inverse_distance) {
    surface(rays, inverse_distance);
  };
}

ViewRequest request_for(const LightFieldFrame& frame, const ViewRequest& request) {
  return {request.view,
          frame,
          request.focal_plane,
          request.options,
          request.result_cache,
          request.working_bytes,
          request.buffers,
          request.count_needed_pixels,
          request.measure_coverage,
          request.use_take_folder,
          request.supersampling,
          request.first_row,
          request.full_height,
          request.group};
}

}  // namespace raystage::render
