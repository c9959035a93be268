// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <span>
#include <stop_token>
#include <string>
#include <vector>

#include "planning/coverage_plan.h"
#include "planning/named_rig.h"

namespace raystage::planning {

/// Returns the rigs of the cameras that face alike: those of one side of a box each. A rig whose
/// cameras are all turned by less than 80 degrees from their mean direction is one array, and so is
/// one that looks outwards (is_outward_array()).
std::vector<NamedRig> split_by_direction(const NamedRig& rig);
/// Returns the same, but divides arrays that look outwards, too.
std::vector<NamedRig> split_into_sides(const NamedRig& rig);

/// Returns whether two rigs have cameras at the same places with the same directions: one array.
bool have_same_cameras(const rig::Rig& a, const rig::Rig& b);

/// Computes the positions from which the arrays together recorded the views (thesis 6.2): each ray
/// counts if an array recorded it that is not hidden by another one. The frame of the plan is in
/// the middle of all cameras, with the axes of the first array. Views that turn are tried at steps
/// of half their field of view, 0.5 to 5 degrees. The range is measured around the position nearest
/// to the middle that is found: of a grid that is twice as large as the arrays, and in the range of
/// each array. Throws Error (bad input) for invalid options, more than 64 arrays, and arrays whose
/// cameras are on a line, look outwards or see no directions in common; Error (failed) if stopped.
/// `progress`: called with the share of the ranges that are done.
CoveragePlan plan_combined_coverage(const std::string& name, std::span<const NamedRig> arrays,
                                    const CoverageOptions& options,
                                    const std::function<void(double)>& progress = {},
                                    const std::stop_token& stop = {});

}  // namespace raystage::planning
