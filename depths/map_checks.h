// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <optional>
#include <span>
#include <string>
#include <vector>

#include "render/depth/inverse_depth_map.h"
#include "rig/rig.h"
#include "schemas/geometry.h"

namespace raystage::depths {

/// What may be wrong with the depths of an imported map.
struct MapFindings {
  bool is_implausible = false;  ///< most are far outside of the take's depth range
  std::size_t too_near = 0;     ///< pixels that became unknown; see check_map()
  /// Largest disparity between neighbouring cameras by which the stored depths are rounded, pixels.
  double rounding_px = 0;
};

/// Checks a map in 1/m, and marks the depths as unknown that are so near that the steps in which
/// files store depths (docs/formats/depth.md) would be too coarse for the others: those more than
/// 64 times nearer than 99 % of the known pixels, unless they are plausible or round the others by
/// less than 0.01 pixels. `parallax`: of neighbour_parallaxes(). `scene`: the take's depth range,
/// if it is known.
MapFindings check_map(render::InverseDepthMap& map, double parallax,
                      const std::optional<schemas::DepthRange>& scene);

/// Returns by camera the disparity to its neighbour, pixels per 1/m: focal length times baseline. A
/// camera alone is treated as if it had a neighbour.
std::vector<double> neighbour_parallaxes(const rig::Rig& rig);

/// Returns the notes of an import about its maps. `files`: as many as findings.
std::vector<std::string> notes_about(std::span<const MapFindings> findings,
                                     const std::vector<std::string>& files);

/// Returns names with commas; after a dozen the number of others.
std::string list_of(const std::vector<std::string>& names);

}  // namespace raystage::depths
