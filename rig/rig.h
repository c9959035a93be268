// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "rig/camera_model.h"
#include "rig/pose.h"
#include "rig/topology.h"
#include "schemas/rig_document.h"

namespace raystage {

/// The physical array, ready for geometry.
struct Rig {
  struct Camera {
    std::string id;
    CameraModel model;
    Pose pose;
    PhotometricResponse photometric;
    std::optional<int> row, column;
  };
  std::string topology_kind = "auto";  ///< as in rig.json: "auto" | "grid" | "delaunay"
  std::vector<Camera> cameras;

  Eigen::Vector3d centre() const;                  ///< mean of the camera centres, world
  Eigen::Vector3d mean_viewing_direction() const;  ///< unit, world
};

/// Throws Error (bad input) when the document holds no camera or an unusable one.
Rig rig_from_document(const RigDocument& document);

/// Topology of the cameras listed (all distinct, in increasing order); cells index into
/// `Rig::cameras`. "auto" takes the grid where every camera has a place in one, otherwise Delaunay.
Topology make_topology(const Rig& rig, std::span<const int> cameras);

/// The plane parallel to the array (across the mean viewing direction) `depth` metres in front of
/// its centre, as a x + b y + c z + d = 0 in the world, (a, b, c) unit. Infinity gives (0, 0, 0,
/// 1).
Eigen::Vector4d fronto_parallel_plane(const Rig& rig, double depth);

/// Eq. 2.2: 1/zopt = (1/zmin + 1/zmax) / 2; zmax may be infinite.
double optimal_focal_depth(DepthRange range);

}  // namespace raystage
