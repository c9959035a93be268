// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <span>

#include "matching/matching.h"
#include "render/depth/inverse_depth_map.h"
#include "render/depth/matching_image.h"

namespace raystage::render {

/// A camera with which the depths of another camera are compared.
struct NeighbourView {
  PixelTransfer transfer;                ///< from the camera whose depths are estimated to this one
  const MatchingImage* image = nullptr;  ///< of this camera
  const InverseDepthMap* depths = nullptr;  ///< of this camera; read by refine_row() only
  int left = 0, top = 0;  ///< of the depths in the image, pixels; nothing is hidden beyond them
};

inline constexpr int kMaxNeighbours = 8;  ///< neighbour_views of match_row()

/// One row of a cost volume over planes of inverse depth `farthest` + i * `step`, 1/m.
struct MatchRow {
  int y = 0;
  const MatchingImage* image = nullptr;            ///< of the camera whose depths are estimated
  std::span<const NeighbourView> neighbour_views;  ///< kMaxNeighbours at most
  double farthest = 0, step = 0;
  int planes = 1, stride = 32;    ///< stride: bytes between the costs of adjacent pixels
  float truncation = 40;          ///< codes of 255
  std::uint8_t* costs = nullptr;  ///< of the first pixel, `planes` each
  std::uint8_t* seen = nullptr;   ///< per pixel: 1 if a neighbour sees it on some plane, else 0
};
/// Writes matching costs: the mean of the smaller half of the absolute luma differences between the
/// camera and the neighbours that see the point. The larger half is left out because occlusions
/// hide the point from some neighbours, on one side. Differences are limited to the truncation,
/// which becomes 255; the cost is kUnknownCost if no neighbour sees the point. Samples are
/// bilinear. Pixels unknown in an image count as unseen.
void match_row(const MatchRow& row);

inline constexpr int kMaxSupportViews = 64;  ///< neighbour_views of refine_row()
inline constexpr int kRefineOffsets = 7;  ///< depths per pixel: -3 to 3 steps from the current one
inline constexpr int kRefineOffsetStride = 8;  ///< floats between the costs of adjacent pixels

/// One row of residuals at depths around the current ones.
struct RefineRow {
  int y = 0;
  const MatchingImage* image = nullptr;
  std::span<const NeighbourView> neighbour_views;  ///< kMaxSupportViews at most
  const float* inverse_depth = nullptr;            ///< current ones of the row, 1/m
  double step = 0;                                 ///< 1/m
  float tolerance = 0;     ///< 1/m; a neighbour whose own depth is nearer by more is occluded
  float truncation = 15;   ///< codes of 255
  float* costs = nullptr;  ///< of the row's first pixel; the eighth of each pixel is 0
};
/// Writes the mean over neighbour views of e^2 / (1 + e^2 / t^2) (Geman and McClure), with e =
/// difference of luma and t = truncation; 0 if no view counts. A view counts if it sees the point
/// at all offsets, by its own depths too: costs are comparable only over the same views.
void refine_row(const RefineRow& row);

inline constexpr int kMaxHypotheses = 32;
inline constexpr int kMaxVotePixels = 32;  ///< pixels per call of vote()

/// A run of pixels with depth hypotheses of several cameras. Arrays have room for kMaxVotePixels.
struct VoteRun {
  std::span<const float* const> hypotheses;  ///< at most kMaxHypotheses; kUnknownDepth if none
  std::span<const float* const> weights;     ///< per hypothesis and pixel, not negative
  int count = 0;                             ///< pixels
  float tolerance = 0;                       ///< 1/m, above 0
  float* depth = nullptr;                    ///< kUnknownDepth if no hypothesis has a weight
  float* support = nullptr;  ///< share of the weights that agree with the depth, 0 to 1
};
/// Selects the hypothesis with the largest support, the nearer of equals, and writes the mean of
/// its supporters. A hypothesis supports another by its weight times 1 - |difference| / tolerance.
void vote(const VoteRun& run);

/// Writes the median of 3 x 3 values for a row; border values are repeated outwards. `rows`: the
/// row above, the row and the one below. A value stays if it exceeds the median by more than
/// `line_tolerance` and two opposite neighbours equal it within that: a line one pixel wide.
void median_row(const std::array<const float*, 3>& rows, float line_tolerance,
                std::span<float> medians);

const char* depth_estimation_target();  ///< returns the name of the instruction set in use

}  // namespace raystage::render
