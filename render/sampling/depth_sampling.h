// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstddef>
#include <cstdint>
#include <span>

#include "render/common/view.h"
#include "render/sampling/source_view.h"
#include "rig/rig.h"
#include "store/processing/frames/frame_cache.h"

namespace raystage {

/// How a frame is read between its pixels. Beyond its outermost centres it goes on unchanged.
enum class Interpolation {
  kLinear,  ///< bilinear
  kCubic    ///< bicubic (Keys 1981, a = kCubicSlope), 4 x 4 pixels; may overshoot
};
/// The kernel's slope one pixel away. With -3/4 views lose less of what is fine, and come nearer to
/// the truth by 0.04 to 0.08 dB, than with -1/2 (Catmull-Rom), where a ramp stays one exactly.
inline constexpr float kCubicSlope = -0.75F;

/// A source camera seen from a view whose pixels have depths of their own. The point at inverse
/// planar depth q (1/m along the view's axis, told from some reference) on the ray of pixel (x, y)
/// has the ideal image point (X/W, Y/W) with
///   (X, Y, W) = camera.ideal_from_pixel * (x, y, 1) + q * per_inverse_depth,
/// seen if W > 0: the direction of the ray, plus its inverse depth times the way from camera to
/// eye; linear in q, and exact for points at infinity.
struct DepthSource {
  SourceView camera;  ///< its frame pointer and planning masks are the user's to set
  std::array<double, 3> per_inverse_depth{};
};

/// Geometry and lens; no frame yet. `view` without its lens distortion. All inverse depths that go
/// with the source are told from `reference` (1/m): an eye far behind a scene sees all of it within
/// a part of its inverse depth that float does not resolve.
DepthSource depth_source(const VirtualCamera& view, const Rig::Camera& camera,
                         double reference = 0);

/// What JpegLayout says that planning needs; `mcus` as for SourceView::wanted_mcus.
void set_mcu_layout(SourceView& camera, const JpegLayout& layout, std::uint8_t* mcus);

/// Adds a camera's samples to a run of pixels of row y, from pixel x on. Per pixel: inverse depth
/// (1/m from the source's reference; not-a-number counts for nothing), weight (0 or more), and in
/// `sums` four floats that grow by weight * seen * (R, G, B, A) in codes of the blend space;
/// `seen` falls from 1 to 0 at the frame's border (kBorderFade) and its lens model's end.
/// Spans of equal lengths (sums: four times). Run-time dispatch, no allocation.
void add_samples_at_depth(const DepthSource& source, int x, int y,
                          std::span<const float> inverse_depth, std::span<const float> weight,
                          Interpolation interpolation, std::span<float> sums);

/// Adds weight * seen * 65535 of the same look-ups to `seen`, one float a pixel: what the sums' A
/// would be if the frames were opaque.
void add_visibility_at_depth(const DepthSource& source, int x, int y,
                             std::span<const float> inverse_depth, std::span<const float> weight,
                             std::span<float> seen);

/// Marks in the camera's wanted_mcus, and in its read_pixels where there are any, what
/// add_samples_at_depth() will read.
void mark_samples_at_depth(const DepthSource& source, int x, int y,
                           std::span<const float> inverse_depth, std::span<const float> weight,
                           Interpolation interpolation);

/// A ray is as opaque as the shares of the cameras that saw it, up to this much of them; from there
/// on it is a picture like any other, though not all of the chosen cameras made it.
inline constexpr float kFullAlphaWeight = 0.1F;
/// Sums become premultiplied linear light (R, G, B, A; code 65535 being `full_scale`); A is the sum
/// of the weights over kFullAlphaWeight, 1 at most. What cubic look-ups overshot is cut off. `rgba`
/// may be `sums`.
void finish_samples(std::span<const float> sums, BlendSpace space, float full_scale,
                    std::span<float> rgba);
/// Of frames with alpha: `seen`, one float a pixel, is what the sums' A would be without (times
/// 65535, see add_visibility_at_depth()). A is then the mean of the frames' times how opaque the
/// ray would be.
void finish_samples(std::span<const float> sums, std::span<const float> seen, BlendSpace space,
                    float full_scale, std::span<float> rgba);

/// The slow, obvious look-up.
struct DepthSample {
  std::array<double, 3> code{};  ///< blend space, full scale 1, times alpha, not cut off
  double alpha = 0;              ///< the frame's, not cut off
  double seen = 0;               ///< 0: not seen, no code
  double u = 0, v = 0;           ///< where in the frame, pixels
};
/// `ray`: of the view's pixel, in the world, scaled to planar depth 1.
DepthSample sample_at_depth_reference(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray,
                                      double inverse_depth, const Rig::Camera& camera,
                                      const DecodedFrame& frame, Interpolation interpolation);

}  // namespace raystage
