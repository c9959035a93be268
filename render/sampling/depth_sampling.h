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

namespace raystage::render {

/// Interpolation between the pixels of a frame. Beyond the outermost pixel centres the frame
/// continues unchanged.
enum class Interpolation {
  kLinear,  ///< bilinear
  kCubic    ///< bicubic (Keys 1981, a = kCubicSlope), 4 x 4 pixels; may overshoot
};
/// Slope of the cubic kernel at distance 1 pixel. With -3/4 views keep more fine detail, and their
/// PSNR is 0.04 to 0.08 dB higher, than with -1/2 (Catmull-Rom), which reproduces ramps exactly.
inline constexpr float kCubicSlope = -0.75F;

/// A source camera for a view whose pixels have individual depths. The point at inverse planar
/// depth q (1/m along the view's axis, relative to some reference) on the ray of pixel (x, y) has
/// the ideal image point (X/W, Y/W) with
///   (X, Y, W) = camera.ideal_from_pixel * (x, y, 1) + q * per_inverse_depth,
/// visible if W > 0. This is the direction of the ray plus q times the vector from the source
/// camera to the virtual camera. It is linear in q, and exact for points at infinity.
struct DepthSource {
  SourceView camera;  ///< the caller sets its frame pointer and planning masks
  std::array<double, 3> per_inverse_depth{};
};

/// Returns geometry and lens of a source camera, without a frame. `view`: its lens distortion is
/// ignored. All inverse depths used with the source are relative to `reference` (1/m), because
/// float does not resolve the absolute ones for a virtual camera far behind a scene.
DepthSource depth_source(const VirtualCamera& view, const rig::Rig::Camera& camera,
                         double reference = 0);

/// Sets what planning needs of JpegLayout; `mcus` as for SourceView::wanted_mcus.
void set_mcu_layout(SourceView& camera, const store::JpegLayout& layout, std::uint8_t* mcus);

/// Adds a camera's samples to a run of pixels of row y, starting at pixel x. Inputs per pixel:
/// inverse depth (1/m from the source's reference; not-a-number contributes nothing) and weight (0
/// or more). Four floats per pixel in `sums` grow by weight * visibility * (R, G, B, A) in codes of
/// the blend space. The visibility falls from 1 to 0 at the frame's border (kBorderFade) and at the
/// limit of the lens model. All spans have equal lengths (sums: four times). Run-time dispatch, no
/// allocation. Must match sample_at_depth_reference().
void add_samples_at_depth(const DepthSource& source, int x, int y,
                          std::span<const float> inverse_depth, std::span<const float> weight,
                          Interpolation interpolation, std::span<float> sums);

/// Adds weight * visibility * 65535 of the same samples to `visibility`, one float per pixel: the A
/// of the sums if the frames were opaque.
void add_visibility_at_depth(const DepthSource& source, int x, int y,
                             std::span<const float> inverse_depth, std::span<const float> weight,
                             std::span<float> seen);

/// Marks what add_samples_at_depth() will read, in the camera's wanted_mcus and, where present, its
/// read_pixels.
void mark_samples_at_depth(const DepthSource& source, int x, int y,
                           std::span<const float> inverse_depth, std::span<const float> weight,
                           Interpolation interpolation);

/// The weight of the cameras that saw a ray up to which the ray's alpha grows. From there on the
/// pixel is opaque although not all chosen cameras saw it.
inline constexpr float kFullAlphaWeight = 0.1F;
/// Converts sums to premultiplied linear light (R, G, B, A; code 65535 is `full_scale`). A is the
/// sum of the weights divided by kFullAlphaWeight, at most 1. Overshoot of cubic interpolation is
/// clamped. `rgba` may be `sums`.
void finish_samples(std::span<const float> sums, store::BlendSpace space, float full_scale,
                    std::span<float> rgba);
/// Converts sums of frames with alpha. `visibility`, one float per pixel, is the A of the sums
/// without the frames' alpha (times 65535, see add_visibility_at_depth()). A becomes the mean of
/// the frames' alpha times the alpha of the ray with opaque frames.
void finish_samples(std::span<const float> sums, std::span<const float> seen,
                    store::BlendSpace space, float full_scale, std::span<float> rgba);

/// A sample of the slow per-ray reference.
struct DepthSample {
  std::array<double, 3> code{};  ///< blend space, full scale 1, times alpha, not clamped
  double alpha = 0;              ///< alpha of the frame, not clamped
  double seen = 0;               ///< 0: not visible, no code
  double u = 0, v = 0;           ///< position in the frame, pixels
};
/// Samples a frame at a depth, in double. `ray`: of the view's pixel, in the world, scaled to
/// planar depth 1.
DepthSample sample_at_depth_reference(const Eigen::Vector3d& eye, const Eigen::Vector3d& ray,
                                      double inverse_depth, const rig::Rig::Camera& camera,
                                      const store::DecodedFrame& frame,
                                      Interpolation interpolation);

}  // namespace raystage::render
