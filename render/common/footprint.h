// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <Eigen/Core>

#include "render/common/light_field_frame.h"
#include "render/common/view.h"

namespace raystage {

/// How many pixels of the cameras, along one axis, a pixel of the view covers where its ray meets
/// `plane`: the most of any camera between which the ray passes and that sees it, and of any of 5x5
/// places in the view; where all of these pass the array by, of the nearest camera that sees. Above
/// 1 the view has less resolution than the light field (thesis 5.3: it must be filtered), below 1
/// more. 0 where no camera sees anything of the view.
double source_pixels_per_pixel(const VirtualCamera& view, const LightFieldFrame& instant,
                               const Eigen::Vector4d& plane);

/// The view with `factor` times as many pixels along each axis, over the same image.
VirtualCamera supersampled(const VirtualCamera& view, int factor);

/// Rows [first, end) of the view as a view of their own: to the rounding, its pixels are theirs.
VirtualCamera crop_rows(const VirtualCamera& view, int first, int end);

/// The mean of factor x factor pixels each: of premultiplied linear light, alpha, coverage and,
/// where measured, cameras; of inverse depths where alpha is above 0, by alpha (they are what is
/// linear on a plane); the least, where measured, of nearest_ray. Statistics
/// and notes are kept. `image`: of a view made by supersampled() with that factor.
RenderedView downsampled(const RenderedView& image, int factor);

/// Puts a view of crop_rows() in its place in the view of all rows, which is made with the first of
/// them, and adds up their statistics: `cameras_used` are those of the rows that use most, and
/// pixels needed in several parts count in each. Notes come once.
void insert_rows(RenderedView&& rows, int first, int height, RenderedView& whole);

}  // namespace raystage
