// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <span>

#include "render/depth/blend_kernels.h"

namespace raystage::render {

/// Where a camera is, seen from the view: along the view's axes, right and up in units of the tile
/// (see AngularFit), ahead both in these and in metres.
struct AngularOffset {
  float right = 0, up = 0, ahead = 0, ahead_m = 0;
};

/// Samples of several cameras at the view's depths, for a run of pixels of one row of a view
/// without lens distortion. Arrays have room for kMaxRunPixels pixels.
struct AngularRun {
  std::span<const float* const> samples;   ///< per camera: R, G, B, seen per pixel; see DepthSource
  std::span<const float* const> weights;   ///< per camera and pixel, 0 to 1
  std::span<const float* const> visible;   ///< per camera and pixel, 0 to 1
  std::span<const AngularOffset> offsets;  ///< per camera
  float slope = 0,
        slope_step = 0;  ///< right per metre ahead: of the first pixel's ray, and per pixel
  float slope_up = 0;    ///< up per metre ahead, of the row's rays
  std::span<const float> inverse_depth;  ///< 1/m, of at most kMaxRunPixels pixels
};

/// The fit of a run's pixels: the light of the ray if it depends on the position of the camera as a
/// quadratic polynomial.
struct AngularFitResult {
  std::array<float, std::size_t{4} * kMaxRunPixels>
      rgba;  ///< R, G, B in codes of 65535; 1 or 0: no fit
  std::array<float, kMaxRunPixels>
      difference;  ///< from the mean: mean square of R, G, B, codes of 255
  std::array<float, kMaxRunPixels>
      noise;  ///< the variance of that difference if there is noise only
};

/// Fits c(x, y) = c0 + c1 x + c2 y + c3 x^2 + c4 x y + c5 y^2 to the samples by weighted least
/// squares; (x, y) is where the line through the pixel's point and the camera meets the plane
/// through the view's centre across its axis, relative to that centre. The result is c0. Weights
/// are weight times visibility; the squares of c1 to c5 count kAngularRidge times these. There is
/// no fit where the cameras that see the point weigh kMinAngularWeight or less, number fewer than
/// kMinAngularCameras, or lie so that c0 has more than kMaxAngularGain times the mean's noise.
void fit_angular(const AngularRun& run, AngularFitResult& result);
inline constexpr int kAngularTerms = 6;
inline constexpr float kAngularRidge = 1e-3F;
inline constexpr float kMinAngularWeight = 0.5F;
inline constexpr float kMinAngularCameras = kAngularTerms + 2;
inline constexpr float kMaxAngularGain = 4;
/// Cameras that are nearer to the plane through the point across the axis do not count: the part of
/// the point's depth.
inline constexpr float kMinAngularDistance = 0.05F;

/// The same for one pixel in double: the reference.
struct AngularSample {
  double x = 0, y = 0;           ///< position of the camera as above
  double weight = 0;             ///< times visibility
  double seen = 0;               ///< visibility
  std::array<double, 3> code{};  ///< codes of 255
};
struct AngularFitOfPixel {
  bool is_valid = false;
  std::array<double, 3> code{};
  double difference = 0, noise = 0;
};
AngularFitOfPixel fit_angular_reference(std::span<const AngularSample> samples);

}  // namespace raystage::render
