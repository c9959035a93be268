// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <span>
#include <string>
#include <vector>

#include "calibrate/geometry/array_model.h"

namespace raystage {

/// A camera's place in a grid of cameras: row 0 at the top, column 0 at the left, seen from behind.
struct GridPosition {
  int row = 0, column = 0;
  bool operator==(const GridPosition&) const = default;
};

/// Brings the world to the array's own axes: x along its rows, y up, z against its viewing
/// direction, the origin in the middle of the cameras. What the array does not tell (a line of
/// cameras has no plane, cameras all around have no rows) the cameras' own axes tell, in the mean.
/// At least one camera must be found.
void align_to_array(ArrayModel& model);

/// Places in the grid that aligned cameras stand in, where they do: all that are found within a
/// third of the spacing of a place of their own, two rows or two columns at least. None otherwise.
std::optional<std::vector<std::optional<GridPosition>>> find_grid_positions(
    const ArrayModel& model);

/// World units from one camera of the grid to the next, along rows and columns in the mean (least
/// squares over all); without a grid, the median distance to the nearest other.
double camera_spacing(const ArrayModel& model);

/// Where the world's scale comes from.
struct ScaleSettings {
  std::optional<double> spacing_m = {};  ///< from one camera to the next
  /// A measured distance between two cameras.
  struct Distance {
    std::string from, to;
    double metres = 0;
  };
  std::optional<Distance> distance = {};
};

/// Makes world units metres. Throws Error (bad input) for a camera that is unknown or not found,
/// or two at the same place. Returns whether anything told the scale.
bool scale_world(ArrayModel& model, const ScaleSettings& settings);

/// Brings the world over known poses (one for each camera, none where unknown), where two cameras
/// at least are known. Returns whether there were. `scales`: its scale, too.
bool align_to_poses(ArrayModel& model, std::span<const std::optional<Pose>> known,
                    bool scales = true);

}  // namespace raystage
