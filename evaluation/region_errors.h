// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <span>
#include <vector>

#include "evaluation/truth_regions.h"
#include "render/common/view.h"
#include "store/jpeg/rgb_image.h"

namespace raystage::evaluation {

/// The error of pictures in a region. NaN without a covered pixel.
struct PictureErrors {
  double psnr_db = 0;
  double ms_ssim = 0;  ///< see render::multi_scale_ssim()
  double share = 0;    ///< of the view's pixels that the region has
};

/// The errors of a view in the regions of its true depths.
struct RegionErrors {
  PictureErrors edge_band, thin;
  /// Shares of the covered pixels of known depth whose depth is wrong by more than half a pixel,
  /// and by more than one pixel, of disparity between neighbouring cameras. NaN without a covered
  /// pixel.
  double bad_depths_half_px = 0, bad_depths_1_px = 0;
  double plane_rms_px = 0;  ///< root mean square of that error where the truth is a plane
  /// Mean absolute errors at covered pixels that show two surfaces, more than one pixel of
  /// disparity apart: of alpha, the share of the one in front, and of its gradient, per pixel. NaN
  /// without such a pixel, or if the true surfaces are unknown.
  double edge_alpha = 0, edge_alpha_gradient = 0;
};

/// A view that is compared.
struct ComparedView {
  const store::RgbImage& image;
  const store::RgbImage& truth;
  std::span<const std::uint8_t> covered;          ///< 1 per pixel that counts
  std::span<const float> z;                       ///< planar depths that were rendered, metres
  std::span<const render::EdgePixel> edges = {};  ///< RenderedView::edges
};

/// `surfaces`: of each pixel; empty: unknown.
RegionErrors region_errors(const ComparedView& view, const TrueDepths& truth,
                           const TruthRegions& regions,
                           std::span<const TrueSurfaces> surfaces = {});

/// Returns the mean of the errors that have a value.
RegionErrors mean_region_errors(std::span<const RegionErrors> errors);

}  // namespace raystage::evaluation
