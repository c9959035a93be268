// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

namespace raystage::evaluation {

/// The depths of a view, by which its pixels are divided into regions.
struct TrueDepths {
  int width = 0, height = 0;
  /// Planar, metres, row by row. Infinite: nothing is seen; 0: unknown, as of mirrors.
  std::span<const float> z;
  /// By how many pixels a point moves between neighbouring cameras, times its depth: focal length
  /// in pixels of the view times their distance, metres.
  double disparity_scale = 0;
};

/// Two surfaces that a pixel shows in truth: the one in front covers a share of it.
struct TrueSurfaces {
  float front_share = 1;            ///< 1: there is one surface; 0: unknown, as of mirrors
  float front_z = 0, behind_z = 0;  ///< planar, metres; infinite: nothing
};

/// Regions of a view where reconstructions differ most: 1 per pixel that is inside.
struct TruthRegions {
  /// Within 8 pixels of an edge of depth: of two adjacent pixels whose disparities differ by more
  /// than one pixel.
  std::vector<std::uint8_t> edge_band;
  /// Within 2 pixels of a structure that is at most 6 pixels wide: along a row, column or diagonal,
  /// what is on both sides of it is farther by more than one pixel of disparity.
  std::vector<std::uint8_t> thin;
  /// Planes: all inverse depths of the 5 x 5 pixels around it are on one plane, as those of a flat
  /// surface are.
  std::vector<std::uint8_t> plane;
};

/// Returns the regions of a view. Cost: some 100 operations a pixel.
TruthRegions truth_regions(const TrueDepths& truth);

}  // namespace raystage::evaluation
