// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <array>
#include <cstddef>
#include <stop_token>
#include <string>
#include <vector>

#include "compose/shot_plan.h"
#include "render/common/view.h"

namespace raystage::replay {

/// Where a view may be so that a share of its rays was recorded, as `raystage plan coverage` has
/// it: exact for ideal arrays and all rays, measured otherwise, and of takes around a volume
/// together.
struct NestedRange {
  std::vector<std::size_t> layers;        ///< of the shot, whose takes count together
  double share = 1;                       ///< of the rays
  double error_m = 0;                     ///< of the surface, metres; 0: it is exact
  std::vector<Eigen::Vector3d> vertices;  ///< in the world; empty: there is no position
  std::vector<std::array<int, 3>> triangles;
  bool is_of_subject = false;  ///< from where a subject is seen, whatever the rest of a view shows
  std::string empty_because = {};  ///< for people, of an empty range of a subject
};

/// Computes the ranges of a view with this orientation and lens, wherever it is, for all, 99 and
/// 90 % of the rays. `interaxial`: metres between the eyes of a stereo camera, or 0. Takes seconds
/// for arrays that are not ideal; precise to a hundredth of the array, but for surfaces that would
/// need more than 600 vertices. Takes without a range are left out. Throws Cancelled.
std::vector<NestedRange> nested_ranges(const compose::ShotPlan& plan,
                                       const render::VirtualCamera& view, double interaxial,
                                       const std::stop_token& stop);

/// Computes for each light field from where every ray to a subject was recorded, as `raystage plan
/// coverage --subject` has it: a cube around `point` (world, metres) with edges of `size` metres.
/// Takes around a volume have none together. Takes milliseconds, for arrays that look outwards
/// seconds. Throws Cancelled.
std::vector<NestedRange> subject_ranges(const compose::ShotPlan& plan, const Eigen::Vector3d& point,
                                        double size, const std::stop_token& stop);

}  // namespace raystage::replay
