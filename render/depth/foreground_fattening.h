// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "render/depth/estimation_kernels.h"
#include "render/depth/inverse_depth_map.h"
#include "render/depth/matching_image.h"

namespace raystage::render {

/// Settings of reduce_foreground_fattening(), which suit all takes.
namespace foreground_fattening {
inline constexpr int kRounds = 3;  ///< background spreads by up to the reach in each
inline constexpr int kReachPerWidth = 20, kLeastReach = 8;  ///< widths of the picture; pixels
/// Depths belong to different surfaces if they are more pixels of disparity apart.
inline constexpr double kApartPx = 1;
/// Pixels have one colour if luma differs by at most so many codes, and chroma.
inline constexpr int kSameColour = 6;
/// Directions, of eight, in which the background must be found.
inline constexpr int kDirections = 3;
/// Codes by which the neighbours may agree less about the background: at a pixel, and in the mean
/// of those around it, of which noise is less.
inline constexpr double kSlack = 4, kMeanSlack = 0.25;
inline constexpr int kMeanRadius = 3;  ///< pixels to each side, of a square
/// Codes by which a depth must be better than one that was found before: equals differ by rounding.
inline constexpr double kBetter = 0.01;
}  // namespace foreground_fattening

/// Returns how far background is searched for in pictures of this width, pixels.
int fattening_reach(int width);

/// Corrects pixels that took the depth of a surface in front of them, such as gaps between spokes
/// (foreground fattening: Scharstein and Szeliski, "A taxonomy and evaluation of dense two-frame
/// stereo correspondence algorithms", IJCV 2002). Where the background has little texture both
/// depths explain the pictures. A pixel takes a depth of the next farther pixels of its own colour
/// along eight directions, or between those of opposite ones, if the neighbours then agree about as
/// well; in several rounds, as pixels that were corrected are background of others. `per_pixel`:
/// the inverse depth, 1/m, that moves a point by a pixel between neighbouring cameras. `reach`:
/// fattening_reach() of the camera, whose picture may be a part. `depths` of `neighbours` are not
/// read.
InverseDepthMap reduce_foreground_fattening(const InverseDepthMap& map, const MatchingImage& image,
                                            std::span<const NeighbourView> neighbours,
                                            double per_pixel, int reach);

}  // namespace raystage::render
