// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <vector>

#include "render/common/light_field_frame.h"
#include "render/common/plane_projection.h"
#include "render/slabs/node_sources.h"
#include "render/slabs/slab_rays.h"

namespace raystage::render {

/// Counts the pixels of the cameras' frames that a view of slabs depends on, for
/// RenderStatistics::pixels_needed. These are each ray's taps in the cameras of the nodes around
/// it, as if it were sampled in the frames themselves. Rectified images are made of whole frames.
class NeededPixels {
 public:
  explicit NeededPixels(const LightFieldFrame& instant);

  /// Marks what a run of pixels of row `y` needs. `projection`: of the view on the focal plane.
  /// `nodes`: of the run's cell, upper left, upper right, lower left, lower right; null where there
  /// is none.
  void mark(const SlabRays& rays, const SlabRays::Run& run, int y, bool nearest,
            const std::array<const NodeSources*, 4>& nodes, const PlaneProjection& projection);

  std::int64_t count() const;

 private:
  void mark_node(const NodeSources& node, int begin, int end, int y,
                 const PlaneProjection& projection);

  const LightFieldFrame& instant_;
  std::vector<std::vector<std::uint8_t>> read_;  // per camera, per pixel; empty: none
};

}  // namespace raystage::render
