// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <vector>

#include "render/common/method.h"
#include "render/slabs/node_sources.h"
#include "render/slabs/slab.h"
#include "render/slabs/slab_kernels.h"

namespace raystage {

/// A rig's slabs at an instant and what each node is made of; the nodes of a slab row by row.
struct RigSlabs {
  std::vector<Slab> slabs;
  std::vector<std::vector<NodeSources>> nodes;  // per slab
};

/// The slabs that the request's options ask for, worked out once and kept.
std::shared_ptr<const RigSlabs> rig_slabs(const ViewRequest& request);
/// Where a slab's rays are looked up: on the focal plane asked for; of a box each face on a plane
/// of its own, as far from the middle of the rig as that.
Eigen::Vector4d slab_focal_plane(const Slab& slab, const ViewRequest& request);
SlabInterpolation slab_interpolation(const MethodOptions& options);

/// Two-plane light field rendering (thesis 2.3 and appendix A; Levoy and Hanrahan 1996). The
/// cameras' frames are rectified into slabs, node by node as views need them, and kept; a ray's
/// crossings with the camera plane and the focal plane are interpolated quadrilinearly. Throws
/// Error (bad input) where one row of the view needs more nodes than fit in `working_bytes`.
RenderedView render_slabs(const ViewRequest& request);

/// Returns what the nodes that are this host's contribute to render_slabs(): sums, one plane. A
/// node is the host's that holds the camera with the largest weight in it; the frames of its other
/// cameras are read, too.
Contribution contribute_slabs(const ViewRequest& request);

/// Returns the view of which all hosts' contributions have these `sums`.
RenderedView combine_slabs(const ViewRequest& request, const PixelValues& sums);

/// The same, ray by ray in double, without slabs: each node is looked up in the frames it is made
/// of. Differs by what rectification costs: one more linear interpolation, except where the image
/// plane falls on the cameras' own.
RenderedView render_slabs_reference(const ViewRequest& request);

const Method& slabs_method();

}  // namespace raystage
