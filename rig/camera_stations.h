// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>
#include <span>
#include <vector>

#include "rig/rig.h"

namespace raystage::rig {

/// Returns by centre (metres) the index of the first centre of its station. The centres of a
/// station are so close together that they count as one viewpoint: a pair behind a beam splitter, a
/// camera that was calibrated twice. Their distances, also by way of others, are at most 1/50 of
/// that to the next centre outside, and at most three of them do not coincide. Stereo pairs and
/// blocks of cameras far from others are thus no stations. Two cameras are one station only if they
/// coincide.
std::vector<int> camera_stations(std::span<const Eigen::Vector3d> centres);
std::vector<int> camera_stations(const Rig& rig);

/// Returns the first centres of the stations, in increasing order, for what the spacing of an array
/// decides. Returns all centres if there are fewer than three stations: the distance of two is no
/// spacing.
std::vector<int> first_of_stations(std::span<const Eigen::Vector3d> centres);

/// Returns the distance of each camera to the nearest one of another station, metres; infinity if
/// there is none. Cost: O(cameras^2).
std::vector<double> nearest_baselines(const Rig& rig);

}  // namespace raystage::rig
