// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "render/common/light_field_frame.h"
#include "render/common/view.h"

namespace raystage::render {

/// Returns the filter footprint of the view: the source pixels per pixel of the view, along one
/// axis, where its rays meet `plane`. It is the maximum over 5x5 positions in the view and over the
/// cameras between which each ray passes and that see the point. Where all these rays miss the
/// array, the nearest camera that sees the point counts. Above 1 the view has less resolution than
/// the light field and must be filtered (thesis 5.3). 0 where no camera sees any of the view.
double source_pixels_per_pixel(const VirtualCamera& view, const LightFieldFrame& instant,
                               const Eigen::Vector4d& plane);

/// Returns the view with `factor` times as many pixels along each axis, over the same image area.
VirtualCamera supersampled(const VirtualCamera& view, int factor);

/// Returns rows [first, end) of the view as a separate view. Its pixels equal those of the whole
/// view up to rounding.
VirtualCamera crop_rows(const VirtualCamera& view, int first, int end);

/// Returns the view downsampled by averaging factor x factor pixels: premultiplied linear light,
/// alpha, coverage and (where measured) cameras. Inverse depths are averaged where alpha is above
/// 0, weighted by alpha, because they are linear on a plane. nearest_ray becomes the minimum where
/// measured. Statistics and notes are kept. `image`: rendered from supersampled() with this factor.
RenderedView downsampled(const RenderedView& image, int factor);

/// Copies a view of crop_rows() into its rows of the full view, which the first call creates. Adds
/// up the statistics: `cameras_used` is the maximum over the parts, and pixels needed in several
/// parts are counted in each. Notes are not repeated.
void insert_rows(RenderedView&& rows, int first, int height, RenderedView& whole);

}  // namespace raystage::render
