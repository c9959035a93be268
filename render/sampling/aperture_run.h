// SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>

#include "render/sampling/source_view.h"

namespace raystage {

/// A camera as a synthetic aperture sees it (thesis, ReconstructionSettings; ApertureLens has the
/// formula).
struct ApertureCamera {
  float x = 0, y = 0;            ///< in the array's plane, m
  float inverse_radius = 0;      ///< 1 / R; 0 where the camera counts everywhere
  bool present = true;           ///< counts for alpha; others only for coverage
  SourceView* source = nullptr;  ///< of those present; without a frame where it sees nothing
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
  /// Its cameras tell where rays cross the array; `source` and `nearest_only` are not used.
  PixelRun cell;
  std::array<std::array<float, 2>, 3> corner{};  ///< where the cell's cameras stand
  std::span<const ApertureCamera> cameras;       ///< all whose weight may be above 0
  ApertureShape shape;
  /// Of the run's pixels, 1 / planar depth, per metre (not-a-number: none), then at least a
  /// vector's room; null: they lie on the cell's plane. `cell.at_infinity` and the sources are then
  /// as for a plane at infinity.
  const float* inverse_depth = nullptr;
  bool opaque = true;  ///< all frames are: A is 65535 throughout
};

/// Marks, in `read_pixels` of the cameras that have them, what blend_aperture_run() reads.
void mark_aperture_pixels(const ApertureRun& run);

/// As blend_run(). Alpha: the part of the light that the cameras present, of which all count with
/// their weight, have seen. `coverage`: the same with those that are absent counted too.
/// `sums`: as blend_run(); cameras without a frame still count in the weights.
void blend_aperture_run(const ApertureRun& run, BlendSpace space, float full_scale, float* rgba,
                        float* coverage, float* z, SumStage sums = SumStage::kSampleAndFinish);

}  // namespace raystage
