// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>
#include <vector>

#include "rig/planning/camera_row.h"
#include "rig/planning/effective_resolution.h"

namespace raystage::planning {

/// The views for which a resolution is planned. Angles in degrees, distances in metres.
struct ResolutionOptions {
  double view_fov_deg = 45;      ///< along the axis
  double max_rotation_deg = 15;  ///< of the views to both sides
  double depth_m = 0;            ///< of the views in front of the array; negative: behind it
  rig::ArrayAxis axis = rig::ArrayAxis::kHorizontal;

  /// Returns whether the options are in range; otherwise `reason` says what is not.
  bool is_valid(std::string* reason) const;
};

/// The effective resolution of views before an array (thesis 5.3 and 5.4).
struct ResolutionPlan {
  struct Row {
    double rotation_deg = 0;
    rig::EffectiveResolution resolution;
  };
  std::string name;  ///< of the rig
  int cameras = 0;
  ResolutionOptions options;
  rig::ArraySampling sampling;
  std::vector<Row> rows;  ///< from no rotation to the largest
  rig::PixelLimitedDepths depths;
  /// Pixels of an unrotated view where rotated cameras sample most coarsely and most finely.
  double coarsest_pixels = 0, finest_pixels = 0;
};

/// Throws Error (bad input) for a rig without cameras or invalid options.
ResolutionPlan plan_resolution(const std::string& name, const rig::Rig& rig,
                               const ResolutionOptions& options);

/// Returns the plan for people, as JSON, or as one self-contained HTML page with charts.
std::string format_resolution_plan(const ResolutionPlan& plan);
std::string resolution_plan_as_json(const ResolutionPlan& plan);
std::string resolution_plan_as_page(const ResolutionPlan& plan);

}  // namespace raystage::planning
