// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "render/sampling/source_view.h"

namespace raystage::render {

/// A camera of a synthetic aperture (thesis, Reconstruction; ApertureLens has the formula).
struct ApertureCamera {
  float x = 0, y = 0;            ///< in the plane of ApertureLens::Plane, m
  float height_squared = 0;      ///< (h / R)^2 of its height h off this plane
  float inverse_radius = 0;      ///< 1 / R; 0 where the camera's weight does not fall off
  bool present = true;           ///< counts for alpha; others count only for coverage
  SourceView* source = nullptr;  ///< of present cameras; without a frame where it sees nothing
  /// DepthSource::per_inverse_depth, for runs whose pixels have depths of their own.
  std::array<double, 3> per_inverse_depth{};
};

/// A synthetic aperture.
struct ApertureShape {
  std::span<const std::array<float, 2>> sides;  ///< ApertureLens::sides()
  float steepness = 1;                          ///< ApertureLens::steepness()
};

/// A run of pixels of one row of the view within one cell of the array.
struct ApertureRun {
  /// Its cameras locate where rays cross the array; `source` and `nearest_only` are not used.
  PixelRun cell;
  std::array<std::array<float, 2>, 3> corner{};  ///< positions of the cell's cameras
  std::span<const ApertureCamera> cameras;       ///< all whose weight may be above 0
  ApertureShape shape;
  /// 1 / planar depth of the run's pixels, per metre (not-a-number: no depth), followed by at least
  /// one vector of padding. Null: the pixels lie on the cell's plane. With depths,
  /// `cell.at_infinity` and the sources are set as for a plane at infinity.
  const float* inverse_depth = nullptr;
  bool opaque = true;  ///< all frames are opaque: A is 65535 throughout
};

/// Marks the pixels that blend_aperture_run() reads, in `read_pixels` of the cameras that have it.
void mark_aperture_pixels(const ApertureRun& run);

/// Reconstructs the run as blend_run() does. Alpha is the part of the weight of the present cameras
/// whose cameras saw the ray. `coverage` is the same relative to absent cameras too. `sums`: as
/// blend_run(); cameras without a frame still count in the weights.
void blend_aperture_run(const ApertureRun& run, store::BlendSpace space, float full_scale,
                        float* rgba, float* coverage, float* z,
                        SumStage sums = SumStage::kSampleAndFinish);

}  // namespace raystage::render
