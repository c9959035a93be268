// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "render/depth/inverse_depth_map.h"
#include "render/depth/matching_image.h"
#include "render/matching/matching.h"

namespace raystage {

/// A camera with which the depths of another camera are compared.
struct NeighbourView {
  PixelTransfer transfer;  ///< to it, from the camera whose depths are sought
  const MatchingImage* image = nullptr;
  const InverseDepthMap* depths = nullptr;  ///< its own; only refine_row() asks
};

inline constexpr int kMaxNeighbours = 8;  ///< neighbour_views of match_row()

/// One row of a cost volume over planes of inverse depth `farthest` + i * `step`, 1/m.
struct MatchRow {
  int y = 0;
  const MatchingImage* image = nullptr;            ///< of the camera whose depths are sought
  std::span<const NeighbourView> neighbour_views;  ///< kMaxNeighbours at most
  double farthest = 0, step = 0;
  int planes = 1, stride = 32;    ///< bytes from a pixel's costs to the next's
  float truncation = 40;          ///< codes of 255
  std::uint8_t* costs = nullptr;  ///< of the first pixel
  std::uint8_t* seen = nullptr;   ///< by pixel: 1 if a neighbour sees it at some plane, else 0
};
/// Writes matching costs of the neighbour views against the camera's own luma: the mean of the
/// smaller half of the absolute differences among those that see the point (an occlusion hides it
/// from some, on one side), each cut off at the truncation, which becomes 255; kUnknownCost where
/// none does. Bilinear. A pixel that an image does not know is seen neither by it nor from it.
void match_row(const MatchRow& row);

inline constexpr int kMaxSupportViews = 64;  ///< neighbour_views of refine_row()
inline constexpr int kRefineOffsets = 7;     ///< depths tried around the present one: -3 to 3 steps
inline constexpr int kRefineOffsetStride = 8;  ///< floats from a pixel's costs to the next's

/// One row of residuals around present depths.
struct RefineRow {
  int y = 0;
  const MatchingImage* image = nullptr;
  std::span<const NeighbourView> neighbour_views;  ///< kMaxSupportViews at most
  const float* present = nullptr;                  ///< inverse depths of the row, 1/m
  double step = 0;                                 ///< 1/m
  float tolerance = 0;     ///< 1/m: a partner whose own depth is nearer by more is hidden
  float truncation = 15;   ///< codes of 255
  float* costs = nullptr;  ///< of the row's first pixel; the eighth of each is 0
};
/// The mean over neighbour_views that see the point at all the depths tried, in their own depths
/// too, of e^2 / (1 + e^2 / t^2), e = difference of luma, t = truncation (Geman and McClure); 0
/// where none does. The same neighbour_views for all depths, or the costs could not be compared.
void refine_row(const RefineRow& row);

inline constexpr int kMaxHypotheses = 32;
inline constexpr int kMaxVotePixels = 32;  ///< pixels voted on at once

/// A run of pixels for which several cameras have depth hypotheses. Every array has room for
/// kMaxVotePixels.
struct VoteRun {
  std::span<const float* const> hypotheses;  ///< kMaxHypotheses at most; kUnknownDepth for none
  std::span<const float* const> weights;     ///< of each report at each pixel, not negative
  int count = 0;                             ///< pixels
  float tolerance = 0;                       ///< 1/m, above 0
  float* depth = nullptr;                    ///< kUnknownDepth where no report has a weight
  float* share = nullptr;                    ///< of the weights that agree, 0 to 1
};
/// Selects the hypothesis with the largest support (weight times 1 - |difference| / tolerance; the
/// nearer of equals) and writes the mean of its supporters.
void vote(const VoteRun& run);

/// The median of 3 x 3 values for a row; the border's go on beyond it. `rows`: the one above, the
/// row itself and the one below. A value that is above the median by more than `line_tolerance`,
/// and like two opposite neighbours within that, stays: it is on a line one pixel wide.
void median_row(const std::array<const float*, 3>& rows, float line_tolerance,
                std::span<float> medians);

/// The instruction set in use.
const char* depth_estimation_target();

}  // namespace raystage
