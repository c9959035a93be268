// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <optional>
#include <vector>

#include "rig/rig.h"

namespace raystage::rig {

/// A rig whose wide fisheyes are replaced by facets (Facet): a few cameras at the same place that
/// look in different directions and share the fisheye's frames. Each sees what a pinhole can show.
struct FacetedRig {
  Rig rig;
  std::vector<int> camera_of_facet;  ///< per camera of `rig`: that of the array
};

/// Returns the facets of a rig, or nullopt if none of its cameras records rays that are farther
/// from its axis than a pinhole shows well (62 degrees). Facets are faces of a cube, which is
/// turned alike for all cameras, limited to what the frame shows, with as many pixels per radian as
/// the middle of the frame.
std::optional<FacetedRig> pinhole_facets(const Rig& rig);

}  // namespace raystage::rig
