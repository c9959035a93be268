// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <functional>
#include <stop_token>
#include <string>

#include "planning/coverage_plan.h"
#include "rig/rig.h"

namespace raystage::planning {

/// Returns whether a rig is one array that looks outwards: a sphere, dome or ring
/// (rig/outward_topology.h), and not the flat sides of a box. Sides are flat if each has three or
/// more cameras that do not look away from one another, and no camera is a fisheye.
bool is_outward_array(const rig::Rig& rig);

/// Returns the frame of an array that looks outwards: its origin is Rig::centre(); it looks along
/// the mean viewing direction, or, where the cameras look to all sides alike, along the world's -z.
/// Its x axis is level (the world's +y is up), unless it looks straight up or down. The y axis of a
/// ring's frame is the ring's normal.
rig::Pose outward_frame(const rig::Rig& rig, const rig::Topology& topology);

/// Computes the ranges of motion of an array that looks outwards, as plan_coverage(), which calls
/// it. All are measured. The range of a ring is flat, in its plane, as that of cameras with one row
/// of pixels. Throws Error (failed) if stopped.
CoveragePlan plan_outward_coverage(const std::string& name, const rig::Rig& rig,
                                   const CoverageOptions& options,
                                   const std::function<void(double)>& progress = {},
                                   const std::stop_token& stop = {});

/// Computes the range of a subject alone, as plan_subject_coverage(), which calls it.
CoveragePlan plan_outward_subject_coverage(const std::string& name, const rig::Rig& rig,
                                           const Eigen::Vector3d& point, double size,
                                           const CoverageOptions& options,
                                           const std::stop_token& stop = {});

}  // namespace raystage::planning
