// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "render/common/view.h"
#include "rig/rig.h"

namespace raystage {

/// What decides how a rig becomes slabs.
struct SlabSettings {
  enum class Layout {
    kSingle,  ///< one slab of all cameras, on the plane of their centres
    kBox      ///< up to six, on the faces of a box; each camera belongs to the face it looks out of
  };
  Layout layout = Layout::kSingle;
  int columns = 0, rows = 0;  ///< nodes of each camera plane; 0: from the rig
  double uv_scale = 1;        ///< image plane samples per finest source pixel, per axis
  double max_fov = 2.6;       ///< radians; what the image plane holds at most, full angle
};

/// A two-plane light field (thesis 2.3 and appendix A; Levoy and Hanrahan 1996, Gortler et al.
/// 1996): a regular grid of nodes on a camera plane (s,t), and for every node an image on one and
/// the same image plane (u,v). (u,v) is relative to the node: all nodes are wall-eyed cameras with
/// the same intrinsics, so that a focal plane enters as a disparity when rays are looked up.
struct Slab {
  /// Of node (0, 0): x along the columns, y up, against the rows; looks down -z, to the scene.
  Pose pose;
  int columns = 1, rows = 1;                   ///< nodes
  double column_spacing = 0, row_spacing = 0;  ///< metres, above 0 where there is more than one
  int width = 0, height = 0;                   ///< samples of a node's image
  Intrinsics image;                            ///< of every node, without distortion
  std::vector<int> cameras;                    ///< of the rig, that it is made of
  /// Directions, unit, world: rays that point as much or more along one of them than along the
  /// slab's own -z belong to another slab (appendix A: the ray's largest axis picks the slab).
  std::vector<Eigen::Vector3d> competing_axes;

  int nodes() const { return columns * rows; }
  Eigen::Vector3d node_position(int column, int row) const;
  /// The node as a camera.
  VirtualCamera node_view(int column, int row) const;
};

/// Slabs of some of a rig's cameras (`cameras` not empty, `normal`: of their plane, towards their
/// back, as Topology::normal).
///
/// Nodes: cameras that stand in a grid give its lattice, by least squares; others a grid over their
/// bounding rectangle, as dense as the median distance to the nearest neighbour. Image plane: holds
/// all that some camera sees (within max_fov), sampled as densely as the finest pixel of any camera
/// projects onto it, so that rectification loses nothing; its samples fall on the pixel centres of
/// the first camera where that is parallel to it.
std::vector<Slab> fit_slabs(const Rig& rig, std::span<const int> cameras,
                            const Eigen::Vector3d& normal, const SlabSettings& settings);

}  // namespace raystage
