// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <cstddef>
#include <vector>

#include "compose/shot_plan.h"
#include "render/common/view.h"
#include "rig/planning/wall_eyed_array.h"

namespace raystage::replay {

/// The ranges of motion of the light fields of a shot (thesis 5.2).
class RangesOfMotion {
 public:
  explicit RangesOfMotion(const compose::ShotPlan& plan);

  /// Where a view may be so that every ray of it was recorded.
  struct Range {
    std::size_t layer = 0;                  ///< of the shot
    std::vector<Eigen::Vector3d> vertices;  ///< of the convex range in the world; empty: nowhere
    bool is_exact =
        false;  ///< otherwise the view may also be elsewhere: of arrays that are not ideal
  };
  /// Returns the ranges of a view with this orientation and lens, wherever it is; none of light
  /// fields whose cameras see no directions in common. `interaxial`: metres between the eyes of a
  /// stereo camera, or 0.
  std::vector<Range> of_view(const render::VirtualCamera& view, double interaxial) const;

 private:
  struct Array {
    std::size_t layer = 0;
    rig::WallEyedArray array;
    bool is_exact = false;
  };
  std::vector<Array> arrays_;
};

}  // namespace raystage::replay
