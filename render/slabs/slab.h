// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <string>
#include <vector>

#include "render/common/view.h"
#include "rig/rig.h"

namespace raystage::render {

/// Settings for fitting slabs to a rig.
struct SlabOptions {
  enum class Layout {
    kSingle,  ///< one slab of all cameras, on the plane of their centres
    kBox      ///< up to six, on the faces of a box; each camera belongs to the face that it faces
  };
  Layout layout = Layout::kSingle;
  int columns = 0, rows = 0;  ///< nodes of each camera plane; 0: from the rig
  double uv_scale = 1;        ///< image plane samples per finest source pixel, per axis
  double max_fov = 2.6;       ///< radians; largest full angle of the image plane
  bool is_valid(std::string* reason) const;
};

/// A two-plane light field (thesis 2.3 and appendix A; Levoy and Hanrahan 1996, Gortler et al.
/// 1996): a regular grid of nodes on a camera plane (s,t), and an image per node on a common image
/// plane (u,v). (u,v) is relative to the node: all nodes are parallel cameras with the same
/// intrinsics, so that a focal plane becomes a disparity when rays are sampled.
struct Slab {
  /// Pose of node (0, 0): x along the columns, y up, opposite to the rows; looks down -z, to the
  /// scene.
  rig::Pose pose;
  int columns = 1, rows = 1;                   ///< nodes
  double column_spacing = 0, row_spacing = 0;  ///< metres, above 0 where there is more than one
  int width = 0, height = 0;                   ///< samples of a node's image
  schemas::Intrinsics image;                   ///< of every node, without distortion
  std::vector<int> cameras;                    ///< of the rig, that it is made of
  /// Unit directions in the world. Rays at least as parallel to one of them as to the slab's own -z
  /// belong to another slab (appendix A: the ray's largest axis selects the slab).
  std::vector<Eigen::Vector3d> competing_axes;

  int nodes() const { return columns * rows; }
  Eigen::Vector3d node_position(int column, int row) const;
  /// Returns the node as a camera.
  VirtualCamera node_view(int column, int row) const;
};

/// Fits slabs to some of a rig's cameras. `cameras`: not empty. `normal`: of their plane, towards
/// their back, as Topology::normal.
///
/// Nodes: cameras in a grid give its lattice, by least squares. Other cameras get a grid over their
/// bounding rectangle, with the median distance to the nearest neighbour as spacing. Image plane:
/// contains all that some camera sees (within max_fov). It is sampled as densely as the finest
/// pixel of any camera projects onto it, so that rectification loses nothing. Its samples coincide
/// with the pixel centres of the first camera where that is parallel to it.
std::vector<Slab> fit_slabs(const rig::Rig& rig, std::span<const int> cameras,
                            const Eigen::Vector3d& normal, const SlabOptions& options);

}  // namespace raystage::render
