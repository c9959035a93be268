// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <array>
#include <limits>
#include <vector>

#include "base/transfer_function.h"
#include "render/common/blending_field.h"
#include "render/confidence.h"
#include "store/processing/frames/matching_code.h"

namespace raystage::render::confidence {

inline constexpr int kConfidenceCameras = 4;  ///< number of cameras compared with a pixel

/// Returns 1/m for a pixel that shows something; 0 at infinity.
inline double inverse_depth_of(float z) { return z > 0 ? 1 / static_cast<double>(z) : 0.0; }

/// Returns the range of inverse depths that a view shows; a point at infinity where it shows
/// nothing.
inline InverseDepthRange shown_inverse_depth_range(const RenderedView& image) {
  InverseDepthRange range{std::numeric_limits<double>::infinity(), 0};
  for (std::size_t i = 0; i < image.z.size(); ++i) {
    if (!(image.rgba[4 * i + 3] > 0)) continue;
    range.farthest = std::min(range.farthest, inverse_depth_of(image.z[i]));
    range.nearest = std::max(range.nearest, inverse_depth_of(image.z[i]));
  }
  return range.empty() ? InverseDepthRange{} : range;
}

/// Returns the blending field of the cameras to compare, for rays at these depths.
inline BlendingField make_blending_field(const VirtualCamera& view, const LightFieldFrame& instant,
                                         const InverseDepthRange& range) {
  return {view, *instant.rig, instant.present_cameras(), range, kConfidenceCameras};
}

/// R, G and B on the sRGB scale, full scale 1.
using SrgbCode = std::array<double, 3>;

/// Converts a pixel of a view that shows something; `scale`: of the frame cache.
inline SrgbCode srgb_code_of_pixel(const float* rgba, const store::CodeScale& scale) {
  SrgbCode code;
  for (std::size_t c = 0; c < 3; ++c) {
    const double part = std::max(0.0, double{rgba[c]} / (double{rgba[3]} * scale.full_scale));
    code[c] = scale.space == store::BlendSpace::kHighRange
                  ? store::matching_code(scale, part * scale.full_scale)
                  : srgb_from_linear(part);
  }
  return code;
}

/// Converts a camera's sample: codes of the blend space times alpha, full scale 1.
inline SrgbCode srgb_code_of_sample(const SrgbCode& times_alpha, double alpha,
                                    const store::CodeScale& scale) {
  SrgbCode code;
  for (std::size_t c = 0; c < 3; ++c) {
    const double own = std::max(0.0, times_alpha[c] / alpha);
    if (scale.space == store::BlendSpace::kHighRange) {
      const double part = store::part_from_value(scale.space, own);
      code[c] = store::matching_code(scale, part * scale.full_scale);
    } else {
      code[c] = scale.space == store::BlendSpace::kPerceptual ? own : srgb_from_linear(own);
    }
  }
  return code;
}

/// Returns the agreement, 0 to 1, of a camera sample with `alpha` and a pixel with `pixel_alpha`.
inline double agreement(const SrgbCode& sample, double alpha, const SrgbCode& pixel,
                        double pixel_alpha) {
  double sum = 0;
  for (std::size_t c = 0; c < 3; ++c) sum += (sample[c] - pixel[c]) * (sample[c] - pixel[c]);
  constexpr double kHalf = kHalfConfidenceDifference / 255;
  return std::min(1.0, alpha / pixel_alpha) / (1 + sum / (3 * kHalf * kHalf));
}

}  // namespace raystage::render::confidence
