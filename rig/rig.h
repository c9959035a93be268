// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <memory>
#include <string>
#include <vector>

#include "rig/camera_model.h"
#include "rig/pose.h"
#include "rig/topology.h"
#include "schemas/rig_document.h"

namespace raystage::rig {

/// The physical camera array with its camera models and poses.
struct Rig {
  struct Camera {
    std::string id;
    CameraModel model;
    Pose pose;
    schemas::PhotometricResponse photometric;
    std::optional<int> row, column;
    double line_time_us = 0;  ///< as CameraGeometry::line_time_us; see rig/row_times.h
  };
  std::string topology_kind = "auto";  ///< as in rig.json: "auto" | "grid" | "delaunay"
  std::vector<Camera> cameras;
  /// The array, if the cameras are facets of its cameras (pinhole_facets.h), otherwise null. Where
  /// it is and looks is a property of the array.
  std::shared_ptr<const Rig> array = nullptr;

  Eigen::Vector3d centre() const;                  ///< mean of the camera centres, world
  Eigen::Vector3d mean_viewing_direction() const;  ///< unit, world
  /// Returns whether the array looks around rather than ahead: its cameras look outwards in
  /// directions that differ, or through fisheyes that see beside the array. No plane is in front of
  /// all that it sees: its depths are distances from its centre.
  bool looks_around() const;
  /// Returns the depth of a point (world) from the array, metres: along the mean viewing direction
  /// from the centre, or, if the array looks around, the distance from the centre.
  double depth_of(const Eigen::Vector3d& point) const;
};

/// Returns the rig of a document. Throws Error (bad input) for no camera or an invalid one.
Rig rig_from_document(const schemas::RigDocument& document);

/// Returns the topology of the given cameras (distinct, in increasing order); cells index into
/// `Rig::cameras`. Cameras that look outwards from a volume get closed cells (outward_topology()).
/// Otherwise "auto" uses the grid if every camera has a row and column, or else Delaunay.
Topology make_topology(const Rig& rig, std::span<const int> cameras);

/// Returns the indices of the cameras that are not in every n-th row and column of the grid, for
/// n = `step`; none for 1. Throws Error (bad input) for a camera without a row and column.
std::vector<int> cameras_off_grid_step(const Rig& rig, int step);

/// Returns the plane a x + b y + c z + d = 0 in the world, with a unit vector (a, b, c). The plane
/// is perpendicular to the mean viewing direction and `depth` metres in front of the array's
/// centre. For an infinite depth returns (0, 0, 0, 1).
Eigen::Vector4d fronto_parallel_plane(const Rig& rig, double depth);
/// Returns the same plane for a virtual camera that looks along `viewing_direction` (unit, world).
/// If the array looks around, the plane is perpendicular to that direction instead: no one plane is
/// in front of all its cameras.
Eigen::Vector4d fronto_parallel_plane(const Rig& rig, double depth,
                                      const Eigen::Vector3d& viewing_direction);

/// Returns the optimal focal depth in metres (thesis eq. 2.2): 1/zopt = (1/zmin + 1/zmax) / 2; zmax
/// may be infinite. Throws Error (bad input) for an invalid range.
double optimal_focal_depth(schemas::DepthRange range);

}  // namespace raystage::rig
