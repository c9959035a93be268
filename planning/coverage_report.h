// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "planning/coverage_plan.h"
#include "rig/rig.h"

namespace raystage::planning {

/// Return the ranges of motion for people, as JSON (raystage/coverage_plan/1), and as one
/// self-contained HTML page with plan, elevation, front and oblique view.
std::string format_coverage_plan(const CoveragePlan& plan);
std::string coverage_plan_as_json(const CoveragePlan& plan);
std::string coverage_plan_as_page(const CoveragePlan& plan);

/// Returns a .gltf document with the rig's cameras and a translucent mesh for each volume, in the
/// world (y up, metres). Surfaces are rounded to float relative to the array's middle.
std::string coverage_plan_as_gltf(const CoveragePlan& plan, const rig::Rig& rig);

/// Returns "45 deg, 99 %": the name of a volume.
std::string name_of(const CoverageVolume& volume);

}  // namespace raystage::planning
