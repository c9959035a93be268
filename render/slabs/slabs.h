// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "render/common/method.h"
#include "render/slabs/node_sources.h"
#include "render/slabs/slab.h"
#include "render/slabs/slab_kernels.h"

namespace raystage::render {

/// A rig's slabs for a light field frame, and the sources of each node; nodes row by row.
struct RigSlabs {
  std::vector<Slab> slabs;
  std::vector<std::vector<NodeSources>> nodes;  // per slab
};

/// Returns the slabs that the request's options describe, from the result cache where possible.
std::shared_ptr<const RigSlabs> rig_slabs(const ViewRequest& request);
/// Returns the plane on which a slab's rays are sampled: the requested focal plane. For a box it is
/// a separate plane per face, at the same distance from the rig's centre.
Eigen::Vector4d slab_focal_plane(const Slab& slab, const ViewRequest& request);
SlabInterpolation slab_interpolation(const MethodOptions& options);

/// Returns the method "slabs": two-plane light fields (thesis 2.3 and appendix A; Levoy and
/// Hanrahan 1996). The cameras' frames are rectified into slabs, node by node as views need them,
/// and cached. A ray's crossings with the camera plane and the focal plane are interpolated
/// quadrilinearly. Throws Error (bad input) where one row of the view needs more nodes than fit in
/// `working_bytes`.
const Method& slabs_method();

/// Renders as the method, per ray in double, without slabs: each node is sampled in the frames of
/// its cameras. The difference is the effect of rectification: one more linear interpolation,
/// except where the image plane coincides with the cameras' own.
RenderedView render_slabs_reference(const ViewRequest& request);

}  // namespace raystage::render
