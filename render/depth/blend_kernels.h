// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "render/depth/inverse_depth_map.h"

namespace raystage {

inline constexpr int kMaxRunPixels = 64;  ///< pixels worked on at once

/// Whether a camera sees the points of a run of a view's pixels, by its own depths: 1 up to
/// `tolerance` (1/m) behind them, falling to 0 at kOcclusionRamp times that; bilinear between the
/// camera's pixels, so soft at edges. 1 outside its image, and where it knows no depth.
struct VisibilityRun {
  int x = 0, y = 0;                          ///< first pixel of the view
  PixelTransfer transfer;                    ///< from the view to the camera
  const InverseDepthMap* depths = nullptr;   ///< the camera's
  const InverseDepthMap* nearest = nullptr;  ///< block_nearest_depths() of them
  std::span<const float> inverse_depth;      ///< of the view's pixels, kMaxRunPixels at most
  float tolerance = 0;
  std::span<float> visible;
};
inline constexpr float kOcclusionRamp = 1.5F;
void compute_visibility(const VisibilityRun& run);

/// Cameras' samples of a run of pixels, to be made one. Each array has room for kMaxRunPixels
/// pixels: vectors may reach beyond the run.
struct BlendRun {
  std::span<const float* const> samples;  ///< per camera: R, G, B, seen a pixel; see DepthSource
  std::span<const float* const> weights;  ///< per camera: of each pixel, 0 to 1
  std::span<const float* const> visible;  ///< per camera: of each pixel, 0 to 1
  int count = 0;                          ///< pixels, kMaxRunPixels at most
  float agreement = 0;                    ///< codes of 65535
};
/// The mean by share and visibility; then, twice, by that and 1 / (1 + d^2 / agreement^2), d = root
/// mean square distance of a sample's colour from the mean. `sums`: mean times A, and A = the
/// weights of cameras that see the point: 0 where something hides it from all. kMinVisibleWeight
/// keeps the mean finite where hardly any does.
inline constexpr float kMinVisibleWeight = 1e-4F;
void blend_reweighted(const BlendRun& run, std::span<float> sums);
inline constexpr int kReweightingRounds = 2;

// The same in steps, for some of the cameras: sums over all cameras, between the steps, give what
// blend_reweighted() gives, but for the rounding.

/// Writes the sums by share and visibility, four a pixel, and the weights of cameras that see the
/// point, times 65535.
void sum_weighted(const BlendRun& run, std::span<float> sums, std::span<float> alpha);
/// Writes the sums by agreement with the mean, which `of_all` (sums of all cameras of the step
/// before) divided by its last value is.
void sum_reweighted(const BlendRun& run, std::span<const float> of_all, std::span<float> sums);

}  // namespace raystage
