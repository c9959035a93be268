// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "render/depth/inverse_depth_map.h"

namespace raystage::render {

inline constexpr int kMaxRunPixels = 64;  ///< pixels per kernel call

/// Inputs and output of compute_visibility(): how far a camera sees the points of a run of a view's
/// pixels, by its own depths. The visibility is 1 up to `tolerance` (1/m) behind them and falls to
/// 0 at kOcclusionRamp times the tolerance. It is bilinear between the camera's pixels, so edges
/// are soft. It is 1 where the camera's depth is unknown. Beyond its depths it is 1, or, if
/// `border` is above 0, falls to 0 over these pixels before their end.
struct VisibilityRun {
  int x = 0, y = 0;                          ///< first pixel of the view
  PixelTransfer transfer;                    ///< from the view to the camera
  const InverseDepthMap* depths = nullptr;   ///< of the camera
  const InverseDepthMap* nearest = nullptr;  ///< block_nearest_depths() of `depths`
  std::span<const float> inverse_depth;      ///< of at most kMaxRunPixels pixels of the view
  float tolerance = 0;
  float border = 0;          ///< pixels
  std::span<float> visible;  ///< output, 0 to 1
};
inline constexpr float kOcclusionRamp = 1.5F;
void compute_visibility(const VisibilityRun& run);
/// Writes the part of the visibility for which the camera's own depth is that of the point: it
/// falls from 1 to 0 where its depth is `tolerance` to kOcclusionRamp times that behind the point,
/// too. Where its depth is unknown, nothing speaks against the point: 1.
/// `run.visible` and `run.nearest` are not used; `at_surface` is as long as `run.inverse_depth`.
void compute_surface_share(const VisibilityRun& run, std::span<float> at_surface);

/// Samples of several cameras for a run of pixels. Each array has room for kMaxRunPixels pixels:
/// vectors may reach beyond the run.
struct BlendRun {
  std::span<const float* const> samples;  ///< per camera: R, G, B, seen per pixel; see DepthSource
  std::span<const float* const> weights;  ///< per camera and pixel, 0 to 1
  std::span<const float* const> visible;  ///< per camera and pixel, 0 to 1
  int count = 0;                          ///< pixels, at most kMaxRunPixels
  float agreement = 0;                    ///< colour difference of half weight, codes of 65535
};
/// Writes `sums`: the mean colour of the cameras times A, and A, the summed weights of cameras that
/// see the point (0 where something hides it from all). The mean is weighted by weight and
/// visibility. Then it is twice weighted by these and 1 / (1 + d^2 / agreement^2), d = root mean
/// square distance of a sample's colour from the mean. kMinVisibleWeight keeps the mean finite for
/// occluded points.
inline constexpr float kMinVisibleWeight = 1e-4F;
void blend_reweighted(const BlendRun& run, std::span<float> sums);
inline constexpr int kReweightingRounds = 2;

// blend_reweighted() in steps, for some of the cameras. If the sums of all cameras are added
// between the steps, the result is that of blend_reweighted() except for rounding.

/// Writes the sums weighted by weight and visibility, four per pixel, and in `alpha` the weights of
/// cameras that see the point, times 65535.
void sum_weighted(const BlendRun& run, std::span<float> sums, std::span<float> alpha);
/// Writes the sums weighted also by agreement with the mean. The mean is `of_all` (the sums of all
/// cameras of the step before) divided by its last value.
void sum_reweighted(const BlendRun& run, std::span<const float> of_all, std::span<float> sums);

}  // namespace raystage::render
