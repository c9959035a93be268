// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <vector>

#include "render/common/plane_projection.h"
#include "render/slabs/slab.h"
#include "render/slabs/slab_kernels.h"
#include "render/slabs/slab_rays.h"

namespace raystage::render {

/// Converts a slab's rays of a view to runs for the kernels: linear functions of the pixel for the
/// nodes around a ray and for where they see its point on the focal plane. `slab`, `rays` and
/// `projection` (both of the view, without its distortion) must outlive it.
class SlabRuns {
 public:
  SlabRuns(const Slab& slab, const SlabRays& rays, const PlaneProjection& projection);

  /// Returns the geometry of a part; node images and interpolation are left unset.
  SlabRun run(const SlabRays::Run& part, int y) const;

 private:
  const Slab& slab_;
  const SlabRays& rays_;
  const PlaneProjection& projection_;
  std::vector<SlabRun::LinearFunction> u_, v_;  // per column, per row of nodes
  SlabRun::LinearFunction ahead_;
};

}  // namespace raystage::render
