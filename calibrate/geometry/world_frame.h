// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calibrate/geometry/array_model.h"

namespace raystage::calibrate {

/// Grid position of a camera: row 0 at the top, column 0 at the left, seen from behind.
struct GridPosition {
  int row = 0, column = 0;
  bool operator==(const GridPosition&) const = default;
};

/// Transforms the world to the array's axes: x along its rows, y up, z against its viewing
/// direction, the origin in the middle of the cameras. Axes that the positions do not determine
/// (cameras in a line or all around) come from the mean of the cameras' own axes. At least one
/// camera must have a pose.
void align_to_array(ArrayModel& model);

/// Returns the grid positions of an aligned array, or none. All cameras with a pose must be within
/// a third of the spacing of different grid points, in at least two rows or two columns.
std::optional<std::vector<std::optional<GridPosition>>> find_grid_positions(
    const ArrayModel& model);

/// Returns the mean spacing along rows and columns of the grid, world units (least squares over all
/// cameras). Without a grid it is the median distance to the nearest other camera.
double camera_spacing(const ArrayModel& model);

/// Source of the world's scale.
struct ScaleOptions {
  std::optional<double> spacing_m = {};  ///< between neighbouring cameras
  /// A measured distance between two cameras.
  struct Distance {
    std::string from, to;
    double metres = 0;
  };
  std::optional<Distance> distance = {};
  bool is_valid(std::string* reason) const;
};

/// Scales the world to metres. Throws Error (bad input) for a camera that is unknown or has no
/// pose, or two at the same position. Returns whether the scale is known.
bool scale_world(ArrayModel& model, const ScaleOptions& options);

/// Aligns the world with known poses (one for each camera, or none) if at least two are known; with
/// `scales` also its scale. Returns whether it was aligned.
bool align_to_poses(ArrayModel& model, std::span<const std::optional<rig::Pose>> known,
                    bool scales = true);

}  // namespace raystage::calibrate
