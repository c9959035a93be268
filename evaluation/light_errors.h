// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>

#include "render/common/view.h"

namespace raystage::evaluation {

/// The error of a view in linear light, not clipped at white.
struct LightErrors {
  /// Of PU21 codes, peak 256; infinity if equal, NaN without covered pixels.
  double pu_psnr_db = 0;
  double highlight_share = 0;  ///< of the covered pixels: those with a true channel above white
  /// Root mean square of log2(view / truth) over the channels of true light above white: 1 is a
  /// factor of two. NaN if there is none.
  double highlight_rms_stops = 0;
};

/// Returns the PU21 code of a linear light, white (1) at 203 cd/m2 (ITU-R BT.2408): 0.005 to
/// 10,000 cd/m2 become 0 to 595, 100 cd/m2 256. Source: Mantiuk and Azimi, "PU21: A novel
/// perceptually uniform encoding for adapting existing quality metrics for HDR", PCS 2021, the
/// variant with glare ("banding_glare").
double pu21_code(double light);

/// Compares a view with its true light: R, G, B per pixel, white = 1. `covered`: 1 per pixel that
/// counts.
LightErrors light_errors(const render::RenderedView& view, std::span<const float> truth,
                         std::span<const std::uint8_t> covered);

/// Returns the mean over views: of the decibels and the stops over those that have a finite value.
LightErrors mean_light_errors(std::span<const LightErrors> views);

}  // namespace raystage::evaluation
